"""Calibration files in the forms that people have them, with the numbers that are in them.

Numbers are of published calibrations, the layout is that of the tool that writes such files.
"""

import io
import json
from typing import Any, NamedTuple

import numpy as np


class Sample(NamedTuple):
    """A file, and what it has: fx, fy, cx, cy; distortion; size; notes."""

    body: bytes
    format: str
    focal: tuple[float, float, float, float] | None
    distortion: tuple[float, ...] | None
    size: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()
    camera: str | None = None
    fisheye: bool = False


K = [[532.79, 0.0, 342.45], [0.0, 532.91, 233.9], [0.0, 0.0, 1.0]]
D = [-0.28, 0.02, 0.001, -0.0001, 0.16]
_FOCAL, _D = (532.79, 532.91, 342.45, 233.9), tuple(D)
_FLAT = [number for row in K for number in row]
_R = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]


def _json(**document: Any) -> bytes:
    return json.dumps(document).encode()


def _npz(**arrays: Any) -> bytes:
    packed = io.BytesIO()
    np.savez(packed, **arrays)
    return packed.getvalue()


_NESTED_YAML = b"""camera_matrix:
- - 532.79
  - 0.0
  - 342.45
- - 0.0
  - 532.91
  - 233.9
- - 0.0
  - 0.0
  - 1.0
dist_coeff:
- - -0.28
  - 0.02
  - 0.001
  - -0.0001
  - 0.16
"""
_NUMPY_TEXT = b"""camera_matrix: |
  [[532.79   0.   342.45]
   [  0.   532.91 233.9 ]
   [  0.     0.     1.  ]]
dist: '[-2.8e-01  2.0e-02  1.0e-03 -1.0e-04  1.6e-01]'
"""
_CAMERA_DATA_XML = b"""<?xml version="1.0"?>
<opencv_storage>
<calibration_Time>"Fri 21 Aug 2015"</calibration_Time>
<image_Width>640</image_Width>
<image_Height>480</image_Height>
<Camera_Matrix type_id="opencv-matrix">
  <rows>3</rows>
  <cols>3</cols>
  <dt>d</dt>
  <data>
    5.3279e+02 0. 3.4245e+02 0. 5.3291e+02 2.339e+02 0. 0. 1.</data></Camera_Matrix>
<Distortion_Coefficients type_id="opencv-matrix">
  <rows>5</rows>
  <cols>1</cols>
  <dt>d</dt>
  <data>
    -2.8e-01 2e-02 1e-03 -1e-04 1.6e-01</data></Distortion_Coefficients>
<Extrinsic_Parameters type_id="opencv-matrix">
  <rows>2</rows>
  <cols>6</cols>
  <dt>d</dt>
  <data>
    1. 2. 3. 4. 5. 6. 7. 8. 9. 10. 11. 12.</data></Extrinsic_Parameters>
</opencv_storage>
"""
_ROS2_ECHO = """header:
  stamp: {{sec: 1662013622, nanosec: 672922214}}
  frame_id: default_cam
height: 480
width: 640
distortion_model: plumb_bob
d: {d}
k: {k}
r: [0.99, -0.14, 0.0, 0.14, 0.99, 0.0, 0.0, 0.0, 1.0]
p: {p}
binning_x: 0
roi: {{x_offset: 0, y_offset: 0, height: 0, width: 0, do_rectify: false}}
---
"""
_ROS1_TUPLES = f"""width: 640
height: 480
distortion_model: rational_polynomial
D: ({", ".join(map(str, [*D, 0.0, 0.0, 0.0]))})
K: ({", ".join(map(str, _FLAT))})
R: ({", ".join(map(str, _R))})
P: ({", ".join(map(str, [*_FLAT[:3], 0.0, *_FLAT[3:6], 0.0, *_FLAT[6:], 0.0]))})
""".encode()
_KALIBR = b"""cam0:
  T_cam_imu:
  - [0.0168, 0.9998, -0.0006, 0.0684]
  - [-0.9998, 0.0168, 0.0004, -0.0147]
  - [0.0004, 0.0006, 0.9999, -0.0037]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.0016, 0.0243, -0.0358, 0.0198]
  distortion_model: equidistant
  intrinsics: [461.487, 460.111, 356.391, 231.157]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
cam1:
  camera_model: pinhole
  distortion_coeffs: [-0.28, 0.07, 0.0002, 0.00002]
  distortion_model: radtan
  intrinsics: [457.587, 456.134, 379.999, 255.238]
  resolution: [752, 480]
"""
_MATLAB = _json(
    IntrinsicMatrix=[[532.79, 0, 0], [0, 532.91, 0], [343.45, 234.9, 1]],
    RadialDistortion=[-0.28, 0.02, 0.16],
    TangentialDistortion=[0.001, -0.0001],
    ImageSize=[480, 640],
)
# An OAK-D's, whose eight coefficients five describe within a tenth of a pixel.
_OAKD = [-3.4751670360565186, -38.5734748840332, 3.4309603506699204e-4, -9.377215610584244e-5,
         286.4400939941406, -3.6408045291900635, -36.68898010253906, 279.0523681640625]  # fmt: skip
_CAMODOCAL = b"""%YAML:1.0
---
model_type: PINHOLE
camera_name: camera
image_width: 640
image_height: 480
distortion_parameters:
   k1: -0.28
   k2: 0.02
   p1: 0.001
   p2: -0.0001
projection_parameters:
   fx: 532.79
   fy: 532.91
   cx: 342.45
   cy: 233.9
"""
_KANNALA_BRANDT = b"""%YAML:1.0

model_type: KANNALA_BRANDT
camera_name: fisheye
image_width: 640
image_height: 400

projection_parameters:
   k2: -0.013
   k3: 0.011
   k4: -0.009
   k5: 0.002
   mu: 190.1
   mv: 190.2
   u0: 320.5
   v0: 199.1
"""
_ORB_SLAM = b"""%YAML:1.0

Camera.type: "PinHole"
Camera.fx: 532.79
Camera.fy: 532.91
Camera.cx: 342.45
Camera.cy: 233.9

Camera.k1: -0.28
Camera.k2: 0.02
Camera.p1: 0.001
Camera.p2: -0.0001
Camera.k3: 0.16

Camera.width: 640
Camera.height: 480
Camera.fps: 30.0
"""
_ROS_INI = b"""[image]

width
640

height
480

[mono_left]

camera matrix
369.344588 0.000000 320.739078
0.000000 367.154330 203.592450
0.000000 0.000000 1.000000

distortion
0.189544 -0.018229 -0.000630 0.000054 -0.000212

rectification
1.000000 0.000000 0.000000
0.000000 1.000000 0.000000
0.000000 0.000000 1.000000

projection
262.927429 0.000000 320.984481 0.000000
0.000000 302.056213 188.592437 0.000000
0.000000 0.000000 1.000000 0.000000

"""
# View 001 of PETS 2009, by the numbers of its published XML.
TSAI = b"""<?xml version="1.0" encoding="UTF-8"?>
<Camera name="View_001">
  <Geometry width="768" height="576" ncx="795" nfx="752" dx="4.85e-03" dy="4.65e-03"
    dpx="5.1273271277e-03" dpy="4.65e-03"/>
  <Intrinsic focal="5.5549183034" kappa1="5.1113043639e-03" cx="324.22149053" cy="282.56650051"
    sx="1.0937855397"/>
  <Extrinsic tx="828.73214225" ty="-3175.4796051" tz="35469.298547"
    rx="2.0405458695" ry="-0.89337703748" rz="-0.43056124791"/>
</Camera>
"""
_STEREO_YAML = f"""%YAML:1.0
---
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: {_FLAT}
D1: {D}
M2: {_FLAT}
D2: {D}
R: {_R}
T: [-0.12, 0.0, 0.0]
""".encode()

SAMPLES = {
    "python json": Sample(_json(camera_matrix=K, dist_coeff=[D]), "OpenCV JSON", _FOCAL, _D),
    "python yaml": Sample(_NESTED_YAML, "OpenCV YAML", _FOCAL, _D),
    "tutorial mtx": Sample(
        _json(mtx=K, dist=[D], rvecs=[[[1], [2], [3]]] * 2, tvecs=[[[1], [2], [3]]] * 2),
        "OpenCV JSON", _FOCAL, _D, notes=("boards",),
    ),
    "tutorial npz": Sample(
        _npz(mtx=np.array(K), dist=np.array([D]), rvecs=np.ones((2, 3, 1))),
        "OpenCV .npz", _FOCAL, _D, notes=("boards",),
    ),
    "numpy text": Sample(_NUMPY_TEXT, "OpenCV YAML", _FOCAL, _D),
    "opencv sample": Sample(
        _CAMERA_DATA_XML, "OpenCV XML", _FOCAL, _D, size=(640, 480), notes=("boards",)
    ),
    "nested object": Sample(
        _json(front={"K": K, "D": D, "image_size": [640, 480]}), "OpenCV JSON", _FOCAL, _D,
        size=(640, 480),
    ),
    "transposed": Sample(
        _json(K=np.array(K).T.tolist(), D=D), "OpenCV JSON", _FOCAL, _D, notes=("transposed",)
    ),
    "ros2 echo": Sample(
        _ROS2_ECHO.format(d=D, k=_FLAT, p=[*_FLAT[:3], 0.0, *_FLAT[3:6], 0.0, *_FLAT[6:], 0.0])
        .encode(),
        "ROS camera_info", _FOCAL, _D, size=(640, 480), notes=("rectification",),
    ),
    "ros1 tuples": Sample(
        _ROS1_TUPLES, "ROS camera_info", _FOCAL, _D, size=(640, 480), notes=("rectification",)
    ),
    "stereo pair": Sample(_STEREO_YAML, "OpenCV YAML", _FOCAL, _D, notes=("stereo_pair",)),
    "stereo with Q": Sample(
        _json(K=K, D=D, R=_R, T=[-0.12, 0, 0], Q=[[1.0] * 4] * 4), "OpenCV JSON", _FOCAL, _D,
        notes=("stereo_pair",),
    ),
    "kalibr fisheye": Sample(
        _KALIBR, "Kalibr", (461.487, 460.111, 356.391, 231.157),
        (-0.0016, 0.0243, -0.0358, 0.0198), size=(752, 480), notes=("rig",), camera="cam0",
        fisheye=True,
    ),
    "kalibr radtan": Sample(
        _KALIBR, "Kalibr", (457.587, 456.134, 379.999, 255.238),
        (-0.28, 0.07, 0.0002, 0.00002, 0.0), size=(752, 480), camera="cam1",
    ),
    "matlab": Sample(
        _MATLAB, "MATLAB cameraParameters", _FOCAL, _D, size=(640, 480),
        notes=("transposed", "counted_from_one"),
    ),
    "realsense": Sample(
        _json(width=640, height=480, fx=615.1, fy=615.3, ppx=320.1, ppy=240.2,
              model="distortion.inverse_brown_conrady", coeffs=[0, 0, 0, 0, 0]),
        "JSON with fx, fy, cx, cy", (615.1, 615.3, 320.1, 240.2), (0.0,) * 5, size=(640, 480),
    ),
    "eight coefficients": Sample(
        _json(K=[[202.62, 0, 124.35], [0, 202.62, 127.29], [0, 0, 1]], D=_OAKD,
              image_size=[250, 250]),
        "OpenCV JSON", (202.62, 202.62, 124.35, 127.29), None, size=(250, 250),
        notes=("fewer_coefficients",),
    ),
    "orb-slam": Sample(
        _ORB_SLAM, "YAML with fx, fy, cx, cy", _FOCAL, _D, size=(640, 480)
    ),
    "camodocal": Sample(
        _CAMODOCAL, "YAML with fx, fy, cx, cy", _FOCAL, (*_D[:4], 0.0), size=(640, 480)
    ),
    "kannala-brandt": Sample(
        _KANNALA_BRANDT, "YAML with fx, fy, cx, cy", (190.1, 190.2, 320.5, 199.1),
        (-0.013, 0.011, -0.009, 0.002), size=(640, 400), fisheye=True,
    ),
    "ros ini": Sample(
        _ROS_INI, "ROS camera_info", (369.344588, 367.15433, 320.739078, 203.59245),
        (0.189544, -0.018229, -0.00063, 0.000054, -0.000212), size=(640, 480),
    ),
    "nerfstudio": Sample(
        _json(camera_model="OPENCV_FISHEYE", fl_x=1000.1, fl_y=1000.2, cx=960.0, cy=540.0, w=1920,
              h=1080, k1=0.02, k2=-0.003, k3=0.0002, k4=0.0, frames=[]),
        "JSON with fx, fy, cx, cy", (1000.1, 1000.2, 960.0, 540.0), (0.02, -0.003, 0.0002, 0.0),
        size=(1920, 1080), fisheye=True,
    ),
    "fisheye by its model": Sample(
        _json(K=[[311.5, 0, 643.7], [0, 310.7, 345.0], [0, 0, 1]], D=[0.065, 0.0019, -0.0129, 2e-3],
              model="equidistant", image_size=[1280, 720]),
        "OpenCV JSON", (311.5, 310.7, 643.7, 345.0), (0.065, 0.0019, -0.0129, 0.002),
        size=(1280, 720), fisheye=True,
    ),
    "tsai": Sample(
        TSAI, "Tsai XML", (1185.0013005, 1194.6060868, 324.22149053, 282.56650051),
        (-0.1576699, 0.0732654, 0.0, 0.0, -0.03564), size=(768, 576),
    ),
    "colmap cameras": Sample(
        b"# Camera list\n1 SIMPLE_RADIAL 640 480 532.79 342.95 234.4 -0.28\n", "COLMAP",
        (532.79, 532.79, 342.45, 233.9), (-0.28, 0.0, 0.0, 0.0, 0.0), size=(640, 480),
    ),
    "krtd": Sample(
        b"532.79 0 342.45\n0 532.91 233.9\n0 0 1\n\n0 1 0\n0 0 -1\n-1 0 0\n\n1 2 3\n\n"
        b"-0.28 0.02 0.001 -0.0001 0.16\n",
        "KRTD", _FOCAL, _D,
    ),
}  # fmt: skip

_PAIR = _json(left={"K": K, "D": D}, right={"K": K, "D": D})
# The coefficients of ros-perception/image_common, issue 33.
_EIGHT = b"-0.000212 0.543582 -0.027892 0.000000"
REJECTED = {
    "ini of eight": (
        _ROS_INI.replace(b"-0.000212", _EIGHT),
        r"ROS camera_info: distortion: 8 coefficients must be within 1 px .* \(got 3.1 px\)",
    ),
    "empty": (b" \n", "file: is empty"),
    "other text": (b"hello", r"file: must be a calibration, OpenCV or .* \(got other text\)"),
    "other yaml": (b"%YAML:1.0\n---\nx: 1\n", "file: must have a camera matrix .* got YAML with x"),
    "half of json": (b"{", "file: damaged JSON"),
    "half of xml": (b"<opencv_storage>", "file: damaged XML"),
    "entity": (b'<!DOCTYPE x [<!ENTITY k "1">]><K>&k;</K>', "file: damaged XML"),
    "alias": (b"a: &a [1]\nK: *a\n", "file: YAML aliases are not taken"),
    "tag without a value": (b'K: !!int ""\n', r"OpenCV YAML: K: must have 9 or 12 numbers \(got 0"),
    "eight of nine": (
        _json(K=_FLAT[:8]), r"OpenCV JSON: K: must have 9 or 12 numbers \(got 8\)"
    ),
    "words": (_json(mtx="wide"), r"OpenCV JSON: mtx: must have 9 or 12 finite numbers \(got other"),
    "no camera matrix": (
        _json(K=[[1, 2, 3], [4, 5, 6], [7, 8, 9]]),
        r"OpenCV JSON: K: must be fx 0 cx / 0 fy cy / 0 0 1 \(got 1 2 3 / 4 5 6 / 7 8 9\)",
    ),
    "rows that are not there": (
        b"K: {rows: 40000, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}", "OpenCV YAML: K: must have"
    ),
    "six coefficients": (
        _json(K=K, D=[0.1] * 6),
        r"OpenCV JSON: distortion: must have 1 or .* or 14 numbers \(got 6\)",
    ),
    "other lens model": (
        b"cam0:\n  camera_model: omni\n  intrinsics: [1, 2, 3, 4, 5]\n",
        r"Kalibr: camera_model: must be pinhole \(got 'omni'\)",
    ),
    "other distortion model": (
        _json(K=K, P=[0.0] * 12, distortion_model="scaramuzza"),
        r"ROS camera_info: distortion_model: must be plumb_bob.* \(got 'scaramuzza'\)",
    ),
    "two cameras": (_PAIR, r"camera: must be one of the 2 in the file: left, right \(got none\)"),
    "colmap model": (
        b"1 FOV 640 480 500 500 320 240 0.1\n", r"COLMAP: cameras.txt: the model .* \(got 'FOV'\)"
    ),
    "colmap numbers": (
        b"1 PINHOLE 640 480 500 320 240\n",
        r"COLMAP: cameras.txt: PINHOLE must have 6 numbers \(got 5\)",
    ),
    "binary": (b"\x89PNG\r\n\x00", r"file: must be text or a ZIP archive \(got binary data\)"),
    "size": (
        _json(K=K, image_size=[640.0, -1]), r"OpenCV JSON: image_size: must be from 1 to 100000 px"
    ),
}  # fmt: skip
