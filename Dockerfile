# Two stages: what builds stays behind. Everything is installed by its hash, torch in its CPU build;
# --build-arg TORCH=cuda takes PyPI's, which is several GB larger and needs no second index.
# --build-arg BASE=python:3.11-slim@sha256:... is for images that others get: docs/contributing.md.
ARG BASE=python:3.11-slim
FROM $BASE AS build
ARG TORCH=cpu
WORKDIR /src
COPY deploy/lock deploy/lock
COPY .ci/install .ci/install
COPY pyproject.toml README.md LICENSE ./
COPY surefoot surefoot
COPY models models
COPY service service
COPY migrations migrations
RUN VENV=/opt/surefoot PIP_NO_CACHE_DIR=1 .ci/install runtime "$TORCH"

FROM $BASE
ARG BASE
LABEL org.opencontainers.image.base.name="$BASE"
RUN useradd --system --uid 10001 --home-dir /data --create-home surefoot
COPY --from=build /opt/surefoot /opt/surefoot
# Others than the container reach it, so that it starts once somebody has a token; see
# docs/guides/access.md: docker run --rm -v surefoot:/data IMAGE surefoot token add NAME --scope admin
ENV PATH=/opt/surefoot/bin:$PATH \
    SUREFOOT_DATA_DIR=/data \
    NUMBA_CACHE_DIR=/data/compiled \
    SUREFOOT_HOST=0.0.0.0 \
    SUREFOOT_PORT=8080
USER surefoot
VOLUME /data
EXPOSE 8080
HEALTHCHECK --interval=30s --timeout=5s --start-period=30s \
    CMD ["python", "-c", "import os, urllib.request as r; r.urlopen('http://127.0.0.1:' + os.environ['SUREFOOT_PORT'] + '/readyz', timeout=4)"]
CMD ["surefoot", "serve"]
