#!/usr/bin/env python3
"""Writes the valid files that the fuzz targets start from: tests/fuzz/make_seeds.py [FOLDER]. Standard library only.

With --dictionaries FOLDER: writes the tokens of each target's seeds there instead, for scripts/fuzz.

Files called crash-* in the same folders are inputs that once broke a reader; they are kept by hand. The video, a
file of our own writer, the HDF5 file, made by h5py, and the files of trackers and markers (pandas 1.5.3 with PyTables 3.7.0,
h5py; the CSV tables hold the same numbers) are kept, too."""
import hashlib
import io
import json
import os
import re
import struct
import sys
import tarfile
import zipfile
import zlib

DICTIONARIES = sys.argv[2] if sys.argv[1:2] == ["--dictionaries"] else None
ROOT = sys.argv[1] if len(sys.argv) == 2 else os.path.join(os.path.dirname(os.path.abspath(__file__)), "seeds")
CUT = "\n--8<--\n"


def put(target, name, content):
    folder = os.path.join(ROOT, target)
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, name), "wb") as file:
        file.write(content if isinstance(content, bytes) else content.encode())


def npy_of(descr, shape, data):
    head = "{'descr': '%s', 'fortran_order': False, 'shape': %r, }" % (descr, shape)
    head += " " * (-(len(head) + 11) % 64) + "\n"
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode() + data


def npz_of(members):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w") as archive:
        for name, data in members.items():
            archive.writestr(zipfile.ZipInfo(name + ".npy"), data)
    return out.getvalue()


def calibration(models):
    cameras = []
    for i, (model, extra) in enumerate(models):
        camera = {"name": f"cam_{i}", "model": model, "size_px": [640, 480]}
        if model == "splined":
            camera["spline"] = {"order": 3, "cols": 6, "rows": 5, "fov_x_deg": 90}
        camera["intrinsics"] = dict({"fx": 500.5, "fy": 501.25, "cx": 319.5, "cy": 239.5}, **extra)
        camera["cam_from_world"] = {"rotation_xyzw": [0.5, -0.5, 0.5, 0.5], "translation": [0.1, -0.2, 3.0 + i]}
        cameras.append(camera)
    return {"schema": "mvstudio.calibration/1", "unit": "m", "gauge": "camera cam_0", "cameras": cameras}


def seed_calibration_json():
    brown = {"k1": -0.1, "k2": 0.02, "p1": 1e-3, "p2": -1e-3, "k3": 0.001}
    put("calibration_json", "perspective.json", json.dumps(calibration([("pinhole", {}), ("brown5", brown)]), indent=1))
    put("calibration_json", "wide.json", json.dumps(calibration([
        ("kannala4", {"k1": 0.01, "k2": 0.002, "k3": 0, "k4": 1e-4}), ("ucm", {"xi": 0.9}),
        ("eucm_p", {"alpha": 0.5, "beta": 1.1, "p1": 0, "p2": 1e-3}), ("doublesphere", {"xi": 0.1, "alpha": 0.6})])))
    put("calibration_json", "splined.json", json.dumps(calibration([("splined", {"control_points": [0.001] * 60})])))
    full = calibration([("pinhole", {})])
    full["cameras"][0]["intrinsics_covariance"] = [[0.01 if i == j else 0 for j in range(4)] for i in range(4)]
    full["cameras"][0]["cam_from_world_covariance"] = [[1e-6 if i == j else 0 for j in range(6)] for i in range(6)]
    full["joint_covariance_lower"] = [[0.0] * i + [0.01 if i < 4 else 1e-6] for i in range(10)]
    put("calibration_json", "covariance.json", json.dumps(full))


def seed_toml():
    camera = ('name = "{0}"\nsize = [640, 480]\nmatrix = [[500.0, 0.0, 320.0], [0.0, 501.0, 240.0], [0.0, 0.0, 1.0]]\n'
              "distortions = {1}\nrotation = {2}\ntranslation = [1.0, 2.0, 3.0]\nfisheye = {3}\n\n")
    vector, matrix = "[0.0, 0.0, 1.5]", "[[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]"
    put("toml", "pose2sim.toml", "[cam_0]\n" + camera.format("cam_0", "[-0.05, 0.02, 0.001, -0.002]", vector, "false") +
        "[cam_1]\n" + camera.format("cam_1", "[0.01, 0.02, 0.03, 0.04]", matrix, "true") + "[metadata]\nerror = 0.0\n")
    put("caliscope", "camera_array.toml", "[cameras.0]\ncam_id = 0\nrotation_count = 0\n" +
        camera.format("a", "[-0.05, 0.02, 0.001, -0.002, 0.1]", matrix, "false") + "[cameras.1]\ncam_id = 1\nignore = true\n" +
        camera.format("b", "[]", vector, "false"))


def seed_qca():
    put("qca", "qca.txt", """<?xml version='1.0'?>
<!-- by hand -->
<calibration created="x &amp; y">
  <cameras>
    <camera serial="7" viewrotation="0">
      <fov_video bottom="1079" left="10" right="1929" top="20"/>
      <transform r11="1" r12="0" r13="0" r21="0" r22="0" r23="1" r31="0" r32="-1" r33="0" x="1000" y="-2000" z="1500"/>
      <intrinsic centerPointU="62080" centerPointV="35840" focalLengthU="64000" focalLengthV="64064" radialDistortion1="-6.4"
        radialDistortion2="3.2" radialDistortion3="0" skew="0" tangentalDistortion1="0.064" tangentalDistortion2="0.128"/>
    </camera>
  </cameras>
</calibration>
""")


def matrix(key, rows, cols, numbers):
    return f"{key}: !!opencv-matrix\n   rows: {rows}\n   cols: {cols}\n   dt: d\n   data: [ {', '.join(map(str, numbers))} ]\n"


K = [500.0, 0, 320.0, 0, 501.0, 240.0, 0, 0, 1]
EYE = [1.0, 0, 0, 0, 1, 0, 0, 0, 1]


def seed_opencv():
    head = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n"
    put("opencv_yaml", "single.yml", head + matrix("camera_matrix", 3, 3, K) +
        matrix("distortion_coefficients", 1, 5, [0.1, -0.2, 1e-3, 2e-3, 0.3]) + matrix("R", 3, 3, EYE) + matrix("T", 3, 1, [0.1, 0, 2]))
    put("opencv_yaml", "stereo.yml", head + matrix("M1", 3, 3, K) + matrix("D1", 1, 14, [0.1, -0.2] + [0] * 12) +
        matrix("M2", 3, 3, K) + matrix("D2", 1, 4, [0.1, 0, 0, 0]) + matrix("R", 3, 1, [0, 0.1, 0]) + matrix("T", 3, 1, [-0.5, 0, 0]))
    put("opencv_yaml", "fisheye.yml", head + "fisheye_model: 1\n" + matrix("K", 3, 3, K) + matrix("D", 4, 1, [0.01, 0.02, 0, 0]))
    names = "%YAML:1.0\n---\nnames:\n  - \"a\"\n  - \"b\"\n"
    intri, extri = names, names
    for name in "ab":
        intri += matrix("K_" + name, 3, 3, K) + matrix("dist_" + name, 1, 5, [-0.1, 0.02, 0, 0, 0]) + f"H_{name}: 480\nW_{name}: 640\n"
        extri += matrix("R_" + name, 3, 1, [0, 0.1, 0]) + matrix("Rot_" + name, 3, 3, EYE) + matrix("T_" + name, 3, 1, [0.1, 0, 2])
    put("easymocap", "two.txt", intri + CUT + extri)


def seed_mrcal():
    text = "{\n    'lensmodel':  '%s',\n    # comment\n    'intrinsics': %s,\n    'extrinsics': [0.1, 0.2, 0.3, 1.0, 2.0, 3.0],\n    'imagersize': [ 640, 480,]\n}\n"
    put("mrcal", "opencv8.cameramodel", text % ("LENSMODEL_OPENCV8", [500.0, 501.0, 320.0, 240.0, 0.1, -0.1, 0, 0, 0, 0.01, 0, 0]))
    put("mrcal", "splined.cameramodel",
        text % ("LENSMODEL_SPLINED_STEREOGRAPHIC_order=2_Nx=5_Ny=4_fov_x_deg=100", [500.0, 501.0, 320.0, 240.0] + [0.001] * 40))


def seed_nerfstudio():
    frame = {"file_path": "images/a.png", "transform_matrix": [[1, 0, 0, 0.5], [0, 1, 0, 0], [0, 0, 1, 2.0], [0, 0, 0, 1]]}
    root = {"camera_model": "OPENCV", "w": 640, "h": 480, "fl_x": 500.5, "fl_y": 501.0, "cx": 320, "cy": 240, "k1": -0.1, "k2": 0.01,
            "p1": 1e-3, "p2": 0, "frames": [frame, dict(frame, file_path="images/b.png", w=320, h=240, camera_angle_x=1.0)]}
    put("nerfstudio", "transforms.json", json.dumps(root, indent=1))
    put("nerfstudio", "fisheye.json", json.dumps(dict(root, camera_model="OPENCV_FISHEYE", p1=0, k3=0.01, k4=0)))


def seed_kalibr():
    put("kalibr", "camchain.yaml", """cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.1, 0.02, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [500.0, 501.0, 320.0, 240.0]
  resolution: [640, 480]
  rostopic: /cam_a/image_raw
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.5]
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  cam_overlaps: [0]
  camera_model: omni
  distortion_coeffs: [0.0, 0.0, 0.001, 0.002]
  distortion_model: radtan
  intrinsics: [1.1, 700.0, 701.0, 320.0, 240.0]
  resolution: [640, 480]
""")
    put("kalibr", "wide.yaml", """# eucm, ds
cam0: {camera_model: eucm, distortion_model: none, intrinsics: [0.5, 1.1, 400.0, 401.0, 320.0, 240.0], resolution: [640, 480]}
cam1:
  T_cn_cnm1: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0.1], [0, 0, 0, 1]]
  camera_model: "ds"
  intrinsics: [0.1, 0.6, 400.0, 401.0, 320.0, 240.0]
  resolution:
    - 640
    - 480
""")


def seed_colmap():
    cameras = "# Camera list with one line of data per camera:\n1 OPENCV 640 480 500 501 320 240 0.1 -0.1 0.001 0\n2 SIMPLE_RADIAL 640 480 500 320 240 0.01\n"
    images = "# Image list\n1 1 0 0 0 0.1 0.2 3 1 a.png\n1.0 2.0 -1\n2 0 1 0 0 0 0 2 2 b cam.png\n\n"
    put("colmap_text", "two.txt", cameras + CUT + images)
    binary = struct.pack("<Q", 2)
    binary += struct.pack("<IiQQ8d", 1, 4, 640, 480, 500, 501, 320, 240, 0.1, -0.1, 1e-3, 0)
    binary += struct.pack("<IiQQ8d", 2, 5, 640, 480, 500, 501, 320, 240, 0.01, 0, 0, 0)
    poses = struct.pack("<Q", 2)
    poses += struct.pack("<I7dI", 1, 1, 0, 0, 0, 0.1, 0.2, 3, 1) + b"a.png\0" + struct.pack("<QddQ", 1, 1.0, 2.0, 2**64 - 1)
    poses += struct.pack("<I7dI", 2, 0, 1, 0, 0, 0, 0, 2, 2) + b"b.png\0" + struct.pack("<Q", 0)
    put("colmap_binary", "two.bin", binary + CUT.encode() + poses)


def seed_detect_and_board():
    for target, name in [("toml", "pose2sim.toml"), ("qca", "qca.txt"), ("kalibr", "camchain.yaml"), ("nerfstudio", "transforms.json")]:
        with open(os.path.join(ROOT, target, name), "rb") as file:
            put("detect_format", name, file.read())
    for i, text in enumerate(["chessboard:9x6:25mm", "charuco:8x6:60mm:45mm:4x4_1000:legacy", "aprilgrid:6x6:88mm:0.3:36h11:first=3:border=2",
                              "tag:36h11:7:100mm:border=1", "grid:10x10:7.7cm"]):
        put("board_text", f"{i}.txt", text)


def seed_corners():
    vnl = "# filename x y level\n"
    for camera in range(2):
        for x, y in [(10, 10), (20.5, 10), (10, 20), (20, 20.25)]:
            vnl += f"cam{camera}-0000.jpg {x} {y} {camera}\n"
    put("corners_vnl", "two.vnl", vnl + "cam1-0001.jpg - - -\n")
    caliscope = "sync_index,cam_id,frame_index,object_id,keypoint_id,img_loc_x,img_loc_y,obj_loc_x,obj_loc_y,obj_loc_z\n"
    for frame in range(2):
        for k in range(6):
            caliscope += f"{frame},{frame},{frame},0,{k},{100 + 10.5 * (k % 3)},{50 + 10 * (k // 3)},{0.01 * (k % 3)},{0.01 * (k // 3)},0\n"
    put("corners_caliscope", "xy.csv", caliscope)
    points, pixels = "", ""
    for k in range(6):
        points += f"{0.01 * (k % 3)} {0.01 * (k // 3)} 0 "
        pixels += f"{100 + 10.5 * (k % 3)} {50 + 10 * (k // 3)} "
    xml = "<?xml version=\"1.0\"?>\n<opencv_storage>\n<imageSize>640 480</imageSize>\n"
    for tag, channels, data in [("objectPoints", 3, points), ("imagePoints", 2, pixels)]:
        xml += (f"<{tag}><_ type_id=\"opencv-matrix\"><rows>6</rows><cols>1</cols><dt>\"{channels}d\"</dt>\n<data>{data}</data></_></{tag}>\n")
    put("corners_opencv", "one.xml", xml + "</opencv_storage>\n")
    csv = "# camera 640x480 cam_a\n# camera 0x0 cam_b\n# board 0 chessboard:3x2:25mm\n# board 1 points\n"
    csv += "# point 1 0 0 0 0\n# point 1 1 0.1 0 0\ncamera,frame,board,corner,x_px,y_px,sigma_px\n"
    for k in range(6):
        csv += f"cam_a,0,0,{k},{100 + 10.5 * (k % 3)},{50 + 10 * (k // 3)},1\n"
    put("corners_csv", "two.csv", csv + "\"cam_b\",3,1,0,5,6,0.5\n\"cam_b\",3,1,1,7,6,0.25\n")


def seed_pose():
    keys = [v for k in range(25) for v in (100.5 + k, 50 + k, 0.9 if k % 5 else 0)]
    hand = [v for k in range(21) for v in (10 + k, 20.5, 0.5)]
    put("openpose_json", "two.json", json.dumps({"version": 1.3, "people": [
        {"person_id": [-1], "pose_keypoints_2d": keys, "face_keypoints_2d": []}, {"pose_keypoints_2d": []}, {}]}))
    put("openpose_parts_json", "hands.json", json.dumps({"version": 1.3, "people": [
        {"person_id": [-1], "pose_keypoints_2d": keys, "hand_left_keypoints_2d": hand, "hand_right_keypoints_2d": []}]}))
    coco = [v for k in range(17) for v in (100 + k, 50.25, 0.8)]
    put("pose_results_json", "coco.json", json.dumps([{"image_id": 3, "keypoints": coco, "score": 1.5}, {"image_id": "000004.jpg", "keypoints": coco}]))
    put("pose_results_json", "mmpose.json", json.dumps({"meta_info": {}, "instance_info": [{"frame_id": 1, "instances": [
        {"keypoints": [[k, 2.5] for k in range(17)], "keypoint_scores": [0.5] * 17}]}]}))
    put("pose2d_csv", "points.csv", "camera,frame,person,joint,x_px,y_px,score\na,0,0,Nose,1.5,2.5,0.9\na,0,0,Neck,,,\na,0,1,Nose,3,4,1\nb,1,0,Nose,5,6,0\n")
    put("pose2d_csv", "few.csv", "\ufeffframe,joint,extra,camera,y_px,x_px\r\n7,marker 1,x,left,2e1,1\r\n")
    put("pose3d", "one.txt", "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n0,0,Nose,Ok,0.1,0.2,1.7,3,0.5,0.002\n0,0,Neck,TooFewViews,,,,1,,\n" +
        CUT + "frame,person,joint,xx,xy,xz,yy,yz,zz\n0,0,Nose,1e-6,0,0,1e-6,0,2e-6\n" + CUT +
        json.dumps({"schema": "mvstudio.pose3d/1", "skeleton": "body25", "points": "points.csv", "unit": "m"}))
    put("trc", "two.trc", "PathFileType\t4\t(X/Y/Z)\tin.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\n60\t60\t2\t2\tm\t60\n"
        "Frame#\tTime\tHip\t\t\tRHip\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n1\t0.0\t0.1\t0.2\t0.3\t0.4\t0.5\t0.6\n2\t0.016\t0.1\t0.2\t0.3\t\t\t\n")
    put("markers_csv", "long.csv", "frame,person,joint,x_m,y_m,z_m,time_s,sigma_m,source\n0,0,Nose,0.1,0.2,1.7,0,0.002,measured\n1,0,Nose,0.1,0.2,1.7,0.02,,filled\n")
    put("markers_csv", "wide.csv", "frame,time,Nose_x_mm,Nose_y_mm,Nose_z_mm\n0,0,1,2,1700\n1,0.02,1,,1700\n")
    put("markers_sto", "vec3.sto", "DataRate=50\nDataType=Vec3\nversion=3\nnRows=2\nnColumns=2\nUnits=m\nendheader\ntime\tNose\n0\t0.1,1.7,0.2\n0.02\t0.1,1.7,0.2\n")
    put("markers_sto", "columns.sto", "points\nversion=1\nnRows=2\nnColumns=4\ninDegrees=no\nUnits=mm\nendheader\ntime\tNose_tx\tNose_ty\tNose_tz\n0\t1\t1700\t2\n0.02\t1\t1700\t2\n")
    put("markers_npz", "two.npz", npz_of({"joints": npy_of("<f8", (2, 1, 1, 3), struct.pack("<6d", 0, 0, 1.7, 0, 0.1, 1.7)),
                                          "joint_names": npy_of("<U4", (1,), "Nose".encode("utf-32-le")),
                                          "frames": npy_of("<i8", (2,), struct.pack("<2q", 0, 1)),
                                          "rate_hz": npy_of("<f8", (), struct.pack("<d", 50))}))
    put("sync_json", "two.json", json.dumps({"schema": "mvstudio.sync/1", "reference": "a", "fps": 29.97, "cameras": [
        {"name": "a", "status": "Ok", "offset_frames": 0, "sigma_frames": 0},
        {"name": "b", "status": "Ok", "offset_frames": -3.25, "sigma_frames": 0.01, "offset_ms": -108.4},
        {"name": "c", "status": "TooFewViews", "offset_frames": None, "sigma_frames": None}]}, indent=1))


def panoptic_camera(name, kind, panel, node):
    return {"name": name, "type": kind, "resolution": [1920, 1080], "panel": panel, "node": node,
            "K": [[1395.91, 0, 950.61], [0, 1392.58, 564.066], [0, 0, 1]], "distCoef": [-0.28, 0.18, 0.0001, -0.0002, 0.05],
            "R": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "t": [[10.5], [20.25], [300.0]]}


def seed_panoptic():
    put("panoptic_calibration", "two.json", json.dumps({"calibDataSource": "160906_calib_norm", "cameras": [
        panoptic_camera("00_03", "hd", 0, 3), panoptic_camera("01_02", "vga", 1, 2)]}, indent=1))
    flat = panoptic_camera("50_01", "kinect-color", 50, 1)
    flat["t"], flat["distCoef"], flat["extra"] = [1, 2, 3], [0] * 5, {"a": [1]}
    put("panoptic_calibration", "flat.json", json.dumps({"cameras": [flat]}))
    joints = [v for j in range(19) for v in ((0, 0, 0, -1) if j == 4 else (10.5 + j, -120.25 + j, 30, 0.5))]
    put("body3d_scene", "two.json", json.dumps({"version": 0.7, "univTime": 53541.542, "fpsType": "hd_29_97", "bodies": [
        {"id": 0, "joints19": joints}, {"id": -1, "joints19": joints}, {"id": 7, "joints19": [0, 0, 0, -1] * 19}]}))


def png(width, height, colour, depth, rows, extra=b""):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colour, 0, 0, 0)) + extra +
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def seed_picture():
    put("picture", "grey.png", png(4, 3, 0, 8, b"".join(b"\0" + bytes([0, 80, 160, 255]) for _ in range(3))))
    put("picture", "rgb.png", png(3, 2, 2, 8, b"".join(b"\1" + bytes(range(9)) for _ in range(2))))
    put("picture", "deep.png", png(2, 2, 2, 16, b"".join(b"\0" + bytes(range(12)) for _ in range(2))))


def seed_more():
    """What came with sessions, Panoptic's other files and networks."""
    put("session_toml", "full.toml", """# by hand
schema = "mvstudio.session/1"
units = "mm"
board = "charuco:7x5:140:105"
calibration = "calib/calibration.json"
fps_hz = 29.97
follow_symlinks = true
cameras = [{name = "cam 01", serial = "123", lens = "8 mm", size_px = [640, 480]}, {name = "b"}]

[[takes]]
name = "board"
footage = "raw/board/{camera}.mp4"

[[takes]]
name = "take1"
fps_hz = 50
timestamps = "raw/take1/times.csv"
sync = "sync/take1.json"
footage = {"cam 01" = "raw/take1/1.mp4", b = "raw/take1/b/*.png"}
plate = {b = "raw/plate/b.png"}
""")
    put("session_toml", "short.toml", 'schema = "mvstudio.session/1"\nunits = "m"\ncameras = ["a", "b"]\ntakes = ["take1"]\n')
    camera = {"name": "a", "source": "a.mp4", "status": "Ok", "frames": 5, "fps_hz": 25.0, "offset_frames": 0, "sigma_frames": 0, "rate_ppm": 0.5,
              "rate_sigma_ppm": 0.1, "jitter_ms": 0.2, "residual_ms": {"median": 0, "max": 1.5}, "dropped": [[2, 1]], "doubled": [4],
              "bad_times": [], "instants": [[0, 0, 3], [4, 3, 1]]}
    put("timeline_json", "two.json", json.dumps({"schema": "mvstudio.timeline/1", "take": "take1", "reference": "a", "clock": "common", "fps_hz": 25,
                                                  "start_s": 0.5, "num_instants": 6, "cameras": [camera, dict(camera, name="b", status="NoTime", instants=[])]}))
    put("timestamps_csv", "two.csv", "cam_id,frame_index,frame_time\n123,0,0.0\n123,1,0.04\n123,2,0.08\nb,5,0.001\nb,6,0.041\nc,0,1\n")
    put("timestamps_csv", "ms.csv", "camera,time_ms\ncam_01,0\ncam_01,40.5\ncam_01,80\nb,1\nb,41\n")
    part = {"cameras": ["00_00", "00_02"], "frames": [0, 1, 2]}
    put("split_json", "one.json", json.dumps({"schema": "mvstudio.split/1", "dataset": "take", "rule": "by hand", "train": part, "validation":
        {"cameras": ["00_00"], "frames": [4]}, "test": {"cameras": ["00_01"], "frames": [6, 7]}, "guard_frames": 1, "unused_frames": [3, 5],
        "motion_blocks": [[0, 7]]}, indent=1))
    for i, text in enumerate(["cam_01" + CUT + "cam 01", "a/../b" + CUT + "a_b", "\u00e9\U0001f600" + CUT + "x" * 200]):
        put("slug", f"{i}.txt", text)
    face = {"landmarks": [0.5 + i for i in range(210)], "averageScore": [0.9] * 70, "averageReproError": [0.5] * 70,
            "visibility": [[0, 3]] * 70}
    hand = {"landmarks": [1.5 * i for i in range(63)], "averageScore": [0.9] * 21, "averageReproError": [0.5] * 21, "visibility": [[1]] * 21}
    put("panoptic_landmarks", "face.json", json.dumps({"version": 0.5, "people": [{"id": 0, "face70": face}, {"id": -1, "face70": face}]}))
    put("panoptic_landmarks", "hand.json", json.dumps({"version": 0.5, "people": [{"id": 0, "left_hand": hand, "right_hand": hand}, {"id": 1, "left_hand": hand}]}))
    put("panoptic_sync_tables", "hd.json", json.dumps({"hd": {"univ_time": [-1, 33.4, 66.7], "index": [0, 1, 2]}, "vga": {"univ_time": [0.1, 40.1]}}))
    put("panoptic_sync_tables", "kinect.json", json.dumps({"kinect": {"color": {"KINECTNODE1": {"univ_time": [1.5, 2.5], "index": [1, 2]}},
                                                                       "depth": {"KINECTNODE1": {"univ_time": [1.5, 2.5]}}}}))
    graph = {"format": "graph-model", "signature": {"outputs": {"out": {"name": "add:0"}}}, "modelTopology": {"node": [
        {"name": "in", "op": "Placeholder", "attr": {"shape": {"shape": {"dim": [{"size": "1"}, {"size": "4"}]}}, "dtype": {"type": "DT_FLOAT"}}},
        {"name": "w", "op": "Const", "attr": {"dtype": {"type": "DT_FLOAT"}, "value": {}}},
        {"name": "add", "op": "AddV2", "input": ["in", "w", "^in"], "attr": {"data_format": {"s": "TkhXQw=="}, "strides": {"list": {"i": ["1", "1"]}}, "f": {"b": True}}}]},
        "weightsManifest": [{"paths": ["w.bin"], "weights": [{"name": "w", "shape": [4], "dtype": "float32",
                                                              "quantization": {"dtype": "uint8", "scale": 0.5, "min": -1}}]}]}
    put("tfjs_graph", "add.txt", json.dumps(graph) + CUT + "abcd")
    header = json.dumps({"__metadata__": {"note": "by \\u0068and"}, "a": {"dtype": "F32", "shape": [2, 1], "data_offsets": [0, 8]},
                         "b": {"dtype": "BOOL", "shape": [], "data_offsets": [8, 9]}}).encode()
    put("safetensors", "two.safetensors", struct.pack("<Q", len(header)) + header + struct.pack("<2f", 1, 2) + b"\1")
    archive = io.BytesIO()
    with tarfile.open(fileobj=archive, mode="w:gz", format=tarfile.USTAR_FORMAT) as tar:
        for name, content in [("package/a.json", b"{}"), ("package/b.bin", b"1234")]:
            info = tarfile.TarInfo(name)
            info.size = len(content)
            tar.addfile(info, io.BytesIO(content))
    data = bytearray(archive.getvalue())
    data[4:8] = bytes(4)  # no time stamp: the same bytes every time
    put("model_archive", "two.tgz", bytes(data))


def seed_pack():
    digest = "60c8cdf32033b70f0544285c6cf0eafc4d3ca69b3ae9d042cf5b5fece0298b62"

    def shard(number):
        return {"file": f"shard-{number:05d}.h5", "shard": number, "num_shards": 2, "bytes": 946222, "sha256": digest, "content_sha256": digest,
                "plan_sha256": digest, "inputs_sha256": digest, "samples": 12, "skipped": ["hdImgs/00_01/00_01_00000004.jpg: damaged"]}
    put("pack_done", "one.json", json.dumps(dict({"schema": "mvstudio.pack-shard/1"}, **shard(0)), indent=1))
    plan = {"schema": "mvstudio.pack-plan/1", "sequence": "take", "crop_px": 256, "codec": "png", "colour": None, "shards": 2}
    put("pack_index", "two.json", json.dumps({"schema": "mvstudio.pack-index/1", "plan_sha256": digest, "plan": plan,
                                              "shards": [shard(0), shard(1)]}, indent=1))


def npy(version, descr, fortran, shape, data):
    header = f"{{'descr': '{descr}', 'fortran_order': {fortran}, 'shape': {shape}, }}"
    size = 2 if version == 1 else 4
    header = header.ljust(-(8 + size + len(header) + 1) % 64 + len(header)) + "\n"
    return b"\x93NUMPY" + bytes([version, 0]) + len(header).to_bytes(size, "little") + header.encode() + data


def npz(compression, arrays):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", compression) as archive:
        for name, content in arrays:
            archive.writestr(zipfile.ZipInfo(name + ".npy"), content, compression)
    return file.getvalue()


def numbers(descr, letter, shape, values):
    return npy(1, descr, False, shape, struct.pack(f"<{len(values)}{letter}", *values))


def texts(values):
    longest = max(len(value) for value in values)
    data = b"".join(value.ljust(longest, "\0").encode("utf-32-le") for value in values)
    return npy(1, f"<U{longest}", False, f"({len(values)},)", data)


def seed_body():
    """Two triangles on two bones, as arrays and as archives."""
    body = [("schema", texts(["mvstudio.body/1"])),
            ("vertices", numbers("<f4", "f", "(4, 3)", [0, 0, 0, 1, 0, 0, 1, 0, 1, 0, 0, 1])),
            ("faces", numbers("<i8", "q", "(2, 3)", [0, 1, 2, 0, 2, 3])), ("face_part", numbers("<i8", "q", "(2,)", [1, 2])),
            ("face_uv", numbers("<f4", "f", "(2, 3, 2)", [0, 0, 1, 0, 1, 1, 0, 0, 1, 1, 0, 1])),
            ("bone_names", texts(["pole", "\u00e4"])), ("bone_roles", numbers("<i8", "q", "(2,)", [1, 0])),
            ("bone_parents", numbers("<i8", "q", "(2,)", [-1, 0])),
            ("bone_heads", numbers("<f8", "d", "(2, 3)", [0, 0, 0, 0.5, 0, 0.25])),
            ("bone_tails", numbers("<f8", "d", "(2, 3)", [0, 0, 1, 0.5, 0, 0.5])),
            ("skin_bones", numbers("<i8", "q", "(4, 4)", [0, 1, 0, 0] * 4)),
            ("skin_weights", numbers("<f4", "f", "(4, 4)", [0.5, 0.5, 0, 0] * 4)),
            ("coco19", numbers("<f8", "d", "(19, 3)", [0.1] * 57)), ("coco19_bone", numbers("<i8", "q", "(19,)", [1] * 19)),
            ("extra.a", numbers("<f8", "d", "(1, 2)", [1, 2]))]
    put("body_npz", "flag.bin", CUT.encode().join(content for _, content in body))
    put("npz", "body.npz", npz(zipfile.ZIP_STORED, body))
    put("npz", "deflated.npz", npz(zipfile.ZIP_DEFLATED, body[1:4]))


def seed_skeletons():
    """As users write them, and as other files keep them."""
    put("skeleton_toml", "mouse.toml", """# by hand
name = "mouse"
joints = ["snout", "left_ear", "right_ear", "back", "tail"]
bones = [["snout", "back"], { joints = ["back", "tail"], length_m = [0.05, 0.1], colour = "#ff8800" }, ["left_ear", "snout"], ["right_ear", "snout"]]
root = "back"
pairs = [["left_ear", "right_ear"]]
up = { from = ["tail"], to = ["snout"] }
""")
    put("skeleton_toml", "parents.toml", """name = "rig"
human = true
joints = ["hip", "knee", "ankle"]
parents = { knee = "hip", ankle = "knee" }
rest_m = { hip = [0, 1, 0], knee = [0, -0.4, 0], ankle = [0, -0.4, 0.0] }
parts = [{ kind = "body", count = 2 }, { kind = "face", count = 1 }]
""")
    put("skeleton_toml", "points.toml", 'name = "points"\njoints = ["a", "b"]\n')
    put("skeleton_json", "mouse.json", json.dumps({"name": "mouse", "joints": ["snout", "back", "tail"],
                                                   "bones": [{"joints": ["snout", "back"], "length_m": [0.02, 0.2]}, ["back", "tail"]],
                                                   "root": "back", "pairs": [], "up": {"from": ["tail"], "to": ["snout"]}}))


def seed_gaussians():
    """Two Gaussians on the two triangles of a square."""
    whole, floats = lambda value: numbers("<i8", "q", "(1,)", [value]), lambda shape, values: numbers("<f4", "f", shape, values)
    for name, degree in (("flat.bin", 0), ("sheen.bin", 1)):
        basis = (degree + 1) ** 2
        arrays = [("schema", texts(["mvstudio.gaussians/1"])), ("seed", texts(["7"])), ("mip", whole(1)), ("size_px", whole(96)),
                  ("step", whole(1500)), ("train_s", numbers("<f8", "d", "(1,)", [12.5])), ("degree", whole(degree)),
                  ("face", numbers("<i8", "q", "(2,)", [1, 0])), ("filter_variance_m2", floats("(2,)", [1e-6, 0])),
                  ("place", floats("(2, 2)", [0.25, 0.5, 0.1, 0.2])), ("offset_m", floats("(2,)", [0.01, -0.005])),
                  ("log_scale", floats("(2, 3)", [-4, -5, -6, -3, -3, -3])),
                  ("rotation", floats("(2, 4)", [0, 0, 0, 1, 0.5, 0.5, -0.5, 0.5])), ("opacity", floats("(2,)", [2, -1])),
                  ("colour", floats(f"(2, {basis}, 3)", [0.1 * k for k in range(6 * basis)])),
                  ("options", texts(["model.gaussians=0", "train.steps=1500"]))]
        put("gaussians_npz", name, CUT.encode().join(content for _, content in arrays))
    put("npz", "gaussians.npz", npz(zipfile.ZIP_STORED, arrays))
    for name, rest in (("plain.ply", 0), ("degree3.ply", 45)):
        names = ["x", "y", "z", "nx", "ny", "nz", *(f"f_dc_{k}" for k in range(3)), *(f"f_rest_{k}" for k in range(rest)),
                 "opacity", *(f"scale_{k}" for k in range(3)), *(f"rot_{k}" for k in range(4))]
        header = "ply\nformat binary_little_endian 1.0\ncomment two of them\nelement vertex 2\n"
        header += "".join(f"property float {attribute}\n" for attribute in names) + "end_header\n"
        values = [0.125 * k for k in range(2 * len(names))]
        put("gaussians_ply", name, header.encode() + struct.pack(f"<{len(values)}f", *values))


def seed_motion():
    joint = "JOINT Spine\n  {\n    OFFSET 0 10 0\n    CHANNELS 3 Zrotation Xrotation Yrotation\n    End Site\n    {\n      OFFSET 0 5 0\n    }\n  }\n"
    put("bvh", "two.bvh", "HIERARCHY\nROOT Hips\n{\n  OFFSET 0.0 0.0 0.0\n  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation\n  " +
        joint + "}\nMOTION\nFrames: 2\nFrame Time: 0.0333333\n0 90 0 1 2 3 4 5 6\n0.5 90.5 -1e1 1 2 3 4 5 6\n")

    put("npy", "doubles.npy", npy(1, "<f8", False, "(2, 3)", struct.pack("<6d", 1, 2.5, -3, 1e300, 5, 6)))
    put("npy", "fortran.npy", npy(2, "<i4", True, "(3, 1, 2)", struct.pack("<6i", *range(6))))
    put("npy", "halves.npy", npy(3, "<f2", False, "(2,)", struct.pack("<2e", 0.5, -2)))
    put("npy", "bytes.npy", npy(1, "|u1", False, "()", b"\x07"))


def seed_runs():
    """What commands keep for later ones."""
    config = {"schema": "mvstudio.avatar-run/1", "dataset": "/data/take", "crop": {
        "size_px": 128, "fill": 0.97, "half_extent_m": 1.1, "person": 0, "joints": 19, "pose3d": ""}, "split": {
        "train_cameras": ["00_00", "00_01"], "train_frames": [1, 2, 3], "holdout_cameras": ["00_02"], "holdout_frames": [4],
        "validation_cameras": [], "validation_frames": []}, "template": {
        "girth": {"trunk": 1, "head": 1.1, "arms": 0.9, "legs": 1}, "input_px": 0, "iou": 0.8, "iuv": ""}}
    put("run_config", "one.json", json.dumps(config, indent=1))
    net = json.dumps({"weightsManifest": [{"paths": ["posenet.bin"], "weights": [{"name": "w", "shape": [1], "dtype": "float32"}]}]})
    put("model_manifest", "one.txt", json.dumps({"schema": "mvstudio.models/1", "package": "p", "version": "3.0.4", "files": {
        "posenet.json": "@net", "posenet.bin": "@weights"}}) + CUT + net + CUT + "abcd")

    def text(value):
        return struct.pack("<Q", len(value)) + value

    def detection(status, corners, soft=False):
        points = struct.pack(f"<{2 * corners}d", *[1.5 * i for i in range(2 * corners)])
        return (struct.pack("<i", status) + text(b"why") + struct.pack("<idiBBd", corners, 0.1, 4, 1, 0, 0.5) +
                struct.pack(f"<Q{corners}i", corners, *range(corners)) + struct.pack("<Q", 2 * corners) + points +
                struct.pack(f"<Q{corners}d", corners, *[0.1] * corners) + struct.pack("<B", soft) + (detection(0, corners) if soft else b""))

    put("detection_cache", "one.bin", text(b"mvstudio detections 7") + struct.pack("<iiQ", 640, 480, 1) + struct.pack("<qQ", 7, 2) +
        detection(0, 3) + detection(1, 2, True))


def seed_scenes():
    put("scene_points", "one.csv", "camera,point,x_px,y_px,x,y,z\na,door,10.5,20,0,1,2\nb,door,11,21,0,1,2\nb,\"lamp, left\",5,6,1,1,1\n")
    put("scene_points", "two.csv", "camera,point,x_px,y_px\na,door,10.5,20\n# by hand\nb,door,11,21\n" + CUT + "point,x,y,z\ndoor,0,1,2\n")
    with open(os.path.join(ROOT, "colmap_binary", "two.bin"), "rb") as file:
        cameras, images = file.read().split(CUT.encode())
    images = images.replace(struct.pack("<QddQ", 1, 1.0, 2.0, 2**64 - 1), struct.pack("<QddQ", 1, 1.0, 2.0, 9))
    points = struct.pack("<Q", 1) + struct.pack("<Q3d3BdQ", 9, 0.5, 0.25, 3, 255, 0, 0, 0.7, 1) + struct.pack("<II", 1, 0)
    put("colmap_scene", "two.bin", cameras + CUT.encode() + images + CUT.encode() + points)


def result(command, metrics, outputs=()):
    return {"schema": "mvstudio.result/1", "command": command, "version": "0.1.0", "status": "ok", "exit": 0, "metrics": metrics,
            "outputs": list(outputs), "warnings": [{"code": "CAL-X", "text": "<b>", "hint": "\u00e9"}], "errors": [],
            "timing": {"wall_s": 1.5, "peak_rss_mb": 10}, "argv": ["mvstudio", command], "time": "2026-01-01T00:00:00Z"}


def seed_report():
    put("report_json", "result.json", json.dumps(result("triangulate", {"rms_px": 0.5, "big": 2**63, "list": [1, [2.5, None, True]]})))
    put("report_csv", "history.csv", "step,phase,loss,wall_s\n10,\"train, early\",0.5,1.25\n20,validation,,2\n")
    cameras = [{"name": "a", "rms_px": 0.3, "views": 12, "residuals": [[1, 2, 0.1, -0.1]], "intrinsics": {"fx": 500}}, {"name": "b"}]
    calibrate = result("calibrate", {"rms_px": 0.3, "cameras": cameras, "checks": [{"name": "c", "value": 1, "limit": 2, "pass": False}],
                                     "holdout": {"rms_px": 0.4}, "film_next": [{"camera": "a", "text": "left"}]},
                       [{"path": "calibration.json", "kind": "calibration"}])
    evaluation = result("avatar eval", {"holdout": {"ssim": {"value": 0.9, "low": 0.8, "high": 0.95}, "fd": {"value": 3}}},
                        [{"path": "eval/a.png", "kind": "picture"}])
    parts = [json.dumps(calibrate), json.dumps(result("triangulate", {"points": 10, "status": {"Ok": 9, "TooFewViews": 1}})),
             json.dumps(evaluation), json.dumps(calibration([("pinhole", {}), ("pinhole", {})])),
             "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n0,0,Nose,Ok,0.1,0.2,1.7,3,0.5,0.002\n",
             "step,phase,loss,wall_s\n10,train,0.5,1.25\n20,validation,0.4,2\n",
             json.dumps({"time": "2026-01-01", "argv": ["mvstudio", "calibrate"], "inputs": [{"path": "a", "sha256": "00"}]}) + "\n{}\n"]
    put("report_run", "all.txt", CUT.join(parts))
    study, methods = hashlib.sha256(b"study").hexdigest(), ["ours", "theirs"]

    def seal(picture, left):
        return hashlib.sha256(f"{study}\n{picture}\n{left}".encode()).hexdigest()[:24]

    answers = [{"picture": f"p{i}", "seal": seal(f"p{i}", methods[i % 2]), "choice": "left" if i < 2 else "right", "seconds": 1.5} for i in range(3)]
    head = {"schema": "mvstudio.study-answers/1", "study": study, "methods": methods}
    put("study_answers", "two.txt", json.dumps(dict(head, rater="one", answers=answers)) + CUT +
        json.dumps(dict(head, rater="two", answers=answers[:1])))


def seed_manifest():
    digest = hashlib.sha256(b"").hexdigest()
    put("manifest", "three.json", """{"schema": "mvstudio.manifest/1",
 "state": "whole",
 "command": "mask",
 "version": "0.1.0",
 "files": [
  {"path": "a b.csv", "size": 12, "sha256": "%s"},
  {"path": "sub/"},
  {"path": "sub/\\udcff\\u000a\\".png", "size": 0, "sha256": "%s", "before": {"size": 3, "sha256": "%s"}}
 ]}
""" % (digest, digest, digest))


def seed_shard():
    rig = json.dumps(calibration([("pinhole", {})]))
    plan = json.dumps({"schema": "mvstudio.pack-plan/1", "sequence": "take", "view": "crop", "codec": "raw", "mask_codec": "png", "shards": 1})
    put("shard_tables", "plain.txt", CUT + plan + CUT + rig)
    edits = "samples/frame 0 7\nposes/frame 0 7\nsamples/K 0 1e3\nsamples/part 0 3\nsamples/univ_time_ms 0 -1\n"
    put("shard_tables", "edits.txt", edits + CUT + plan + CUT + rig)
    put("shard_tables", "cut.txt", "samples/frame cut 0\nposes/valid 19 1\nsamples/image_offset 0 99999999999\n" + CUT +
        plan.replace("crop", "full") + CUT + rig)


HOSTILE = ["1e400", "-1e-400", "NaN", "Infinity", "null", "true", "{}", "[]", "\"\"", "-1", "0", "1e9", "99999999999999999999", "../", "\\u0000"]


def write_dictionaries():
    """A token list for each target: the words of its text seeds and some that readers get wrong."""
    os.makedirs(DICTIONARIES, exist_ok=True)
    for target in sorted(os.listdir(ROOT)):
        words = set()
        for name in sorted(os.listdir(os.path.join(ROOT, target))):
            with open(os.path.join(ROOT, target, name), "rb") as file:
                text = file.read()
            if not name.startswith("crash") and target not in ("picture", "video", "model_archive", "shard_bytes", "npz"):
                words.update(word.decode() for word in re.findall(rb"[A-Za-z_!%#<][A-Za-z0-9_!:.-]{2,31}", text))
        lines = [json.dumps(word) for word in HOSTILE + sorted(words)[:150]]
        with open(os.path.join(DICTIONARIES, target + ".dict"), "w", encoding="ascii") as file:
            file.write("\n".join(lines) + "\n")


def main():
    if DICTIONARIES:
        return write_dictionaries()
    for seed in [seed_calibration_json, seed_toml, seed_qca, seed_opencv, seed_mrcal, seed_nerfstudio, seed_kalibr, seed_colmap,
                 seed_detect_and_board, seed_corners, seed_pose, seed_panoptic, seed_picture, seed_more, seed_pack, seed_motion, seed_body, seed_skeletons, seed_gaussians,
                 seed_runs, seed_scenes, seed_report, seed_manifest, seed_shard]:
        seed()


main()
