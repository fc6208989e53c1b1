# Two stages: what builds stays behind. On machines without a GPU, pass
# --build-arg PIP_EXTRA_INDEX_URL=<the index of torch's CPU builds> for a much smaller image.
FROM python:3.11-slim AS build
ARG PIP_EXTRA_INDEX_URL=""
WORKDIR /src
COPY pyproject.toml .constraints.txt README.md LICENSE ./
COPY models models
COPY service service
COPY migrations migrations
RUN python -m venv /opt/surefoot \
    && /opt/surefoot/bin/pip install --no-cache-dir -c .constraints.txt .

FROM python:3.11-slim
RUN useradd --system --uid 10001 --home-dir /data --create-home surefoot
COPY --from=build /opt/surefoot /opt/surefoot
# Others than the container reach it, so that it starts once somebody has a token; see Access in
# service/README.md: docker run --rm -v surefoot:/data IMAGE surefoot token add NAME --scope admin
ENV PATH=/opt/surefoot/bin:$PATH \
    SUREFOOT_DATA_DIR=/data \
    SUREFOOT_HOST=0.0.0.0 \
    SUREFOOT_PORT=8080
USER surefoot
VOLUME /data
EXPOSE 8080
HEALTHCHECK --interval=30s --timeout=5s --start-period=30s \
    CMD ["python", "-c", "import os, urllib.request as r; r.urlopen('http://127.0.0.1:' + os.environ['SUREFOOT_PORT'] + '/readyz', timeout=4)"]
CMD ["surefoot", "serve"]
