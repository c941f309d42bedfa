"""A run made up of results, which `mvstudio report` makes a page of that has every part a script or a finger can touch."""
import json
import math
import struct
import zlib

JOINTS = ("Head", "Neck", "MidHip", "LHand", "RHand", "LFoot", "RFoot")
BONES = [["Head", "Neck"], ["Neck", "MidHip"], ["Neck", "LHand"], ["Neck", "RHand"], ["MidHip", "LFoot"], ["MidHip", "RFoot"]]
CAMERAS, FRAMES, WORST_FRAME, MISSING_FRAME = 4, 48, 30, 21
SIZE = (640, 480)
DATASET_COLOURS = ((60, 100, 200), (120, 200, 60), (200, 60, 120))  # of the images of each camera
MASK_BOX = (200, 100, 440, 400)  # left, top, right, bottom of the masks


def png(width, height, colour_at):
    """An RGB image; `colour_at(x, y)`: (r, g, b)."""
    return png_of_rows(width, height, b"".join(b"\0" + bytes(min(v, 255) for x in range(width) for v in colour_at(x, y)) for y in range(height)))


def png_of_rows(width, height, rows):
    """`rows`: each with the byte of its filter before it."""
    chunk = lambda name, data: struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)) +
            chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b""))


def save(path, content):
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")


def result(command, metrics, outputs=(), warnings=(), errors=(), status="ok"):
    return {"schema": "mvstudio.result/1", "command": command, "version": "0.2.0", "status": status, "exit": 0, "metrics": metrics,
            "outputs": [{"path": path, "role": role} for path, role in outputs], "warnings": list(warnings), "errors": list(errors),
            "timing": {"wall_s": 1.5, "peak_rss_mb": 10.0}, "argv": ["mvstudio", *command.split(), "--board", "charuco:7x5:140mm:105mm"]}


def rig(names):
    """Cameras 3 m from the axis of z, 1.2 m above the floor, that look at it."""
    cameras = []
    for i, name in enumerate(names):
        angle = 2 * math.pi * i / len(names)
        away = (math.cos(angle), math.sin(angle))
        rows = ((-away[1], away[0], 0), (0, 0, -1), (-away[0], -away[1], 0))  # right, down, forward
        centre = (3 * away[0], 3 * away[1], 1.2)
        cameras.append({"name": name, "model": "pinhole", "size_px": list(SIZE),
                        "intrinsics": {"fx": 500, "fy": 500, "cx": 319.5, "cy": 239.5},
                        "cam_from_world": {"rotation_xyzw": quaternion(rows),
                                           "translation": [-sum(r * c for r, c in zip(row, centre)) for row in rows]}})
    return cameras


def quaternion(m):
    """x, y, z, w of a rotation by its largest component (Shepperd 1978)."""
    traces = (m[0][0] + m[1][1] + m[2][2], m[0][0], m[1][1], m[2][2])
    k = traces.index(max(traces))
    if k == 0:
        w = math.sqrt(1 + traces[0]) / 2
        return [(m[2][1] - m[1][2]) / (4 * w), (m[0][2] - m[2][0]) / (4 * w), (m[1][0] - m[0][1]) / (4 * w), w]
    i, j, l = k - 1, k % 3, (k + 1) % 3
    q = [0.0] * 4
    q[i] = math.sqrt(1 + m[i][i] - m[j][j] - m[l][l]) / 2
    q[j], q[l] = (m[j][i] + m[i][j]) / (4 * q[i]), (m[l][i] + m[i][l]) / (4 * q[i])
    q[3] = (m[l][j] - m[j][l]) / (4 * q[i])
    return q


def joint_at(joint, frame):
    """Metres in world: somebody who walks in a circle of half a metre."""
    turn = 2 * math.pi * frame / 90
    side, up = {"Head": (0, 1.7), "Neck": (0, 1.45), "MidHip": (0, 0.95), "LHand": (0.45, 1.1), "RHand": (-0.45, 1.1), "LFoot": (0.15, 0.05),
                "RFoot": (-0.15, 0.05)}[joint]
    return (0.5 * math.cos(turn) - side * math.sin(turn), 0.5 * math.sin(turn) + side * math.cos(turn), up)


def save_take(run):
    points, covariances = ["frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m"], ["frame,person,joint,xx,xy,xz,yy,yz,zz"]
    for frame in range(FRAMES):
        for joint in JOINTS:
            if frame == MISSING_FRAME and joint == "LHand":
                points.append(f"{frame},0,{joint},LowParallax,,,,1,,")
                continue
            x, y, z = joint_at(joint, frame)
            rms = 6.5 if frame == WORST_FRAME else 1 + 0.01 * frame
            points.append(f"{frame},0,{joint},Ok,{x:.6f},{y:.6f},{z:.6f},{CAMERAS},{rms},0.004")
            covariances.append(f"{frame},0,{joint},0.000016,0,0,0.000016,0,0.00009")
    save(run / "pose3d/take1/pose3d.json", {"schema": "mvstudio.pose3d/1", "skeleton": "seven", "points": "points.csv", "covariance": "covariance.csv",
         "unit": "m", "frame_rate_hz": 25.0, "definition": {"name": "seven", "human": True, "joints": JOINTS, "bones": BONES}})
    save(run / "pose3d/take1/points.csv", "\n".join(points) + "\n")
    save(run / "pose3d/take1/covariance.csv", "\n".join(covariances) + "\n")


def save_calibration(run, names):
    save(run / "calib/calibration.json", {"schema": "mvstudio.calibration/1", "unit": "m", "gauge": "board in frame 0, z up", "cameras": rig(names)})
    cameras, residuals, views = [], {}, []
    for i, name in enumerate(names):
        cameras.append({"name": name, "model": "brown4", "num_params": 8, "focal_px": 500 + i, "focal_sigma_px": 0.3, "rms_px": 0.8 if i == 2 else 0.2,
                        "holdout_rms_px": 0.9 if i == 2 else 0.25, "coverage": 0.7, "num_rejected": 1, "num_images": 30, "num_views": 14,
                        "coverage_cells": [[(r * c + i) % 5 for c in range(10)] for r in range(8)],
                        "uncertainty_map_px": [[0.1 + 0.01 * ((r - 4) ** 2 + (c - 6) ** 2) for c in range(12)] for r in range(8)]})
        residuals[name] = [[20 * k % 640, 13 * k % 480, 0.2 * math.sin(k), 0.2 * math.cos(k)] for k in range(60)]
        save(run / f"calib/board-views/{i}.png", png(64, 48, lambda x, y: (200, 200, 200) if (x // 8 + y // 8) % 2 else (40 + 40 * i, 60, 80)))
        corners = [[100 + 40 * c, 100 + 40 * r, 0.3, -0.2, 0] for r in range(4) for c in range(6)]
        views.append({"camera": name, "frame": 13, "kind": "ordinary", "rms_px": 0.3, "box_px": [60, 60, 400, 300],
                      "picture": f"board-views/{i}.png", "corners": corners})
    warnings = [{"code": "CAL-LOWCOV", "text": f"camera {names[2]} saw the board in few places", "hint": "show it everywhere"}]
    save(run / "calib/calibrate.result.json", result("calibrate", {"rms_px": 0.4, "holdout_rms_px": 0.45, "num_frames": 30, "cameras": cameras,
         "residuals": residuals, "board_views": views, "covisibility": [[14] * len(names)] * len(names)}, warnings=warnings, status="warn"))
    save(run / "calib/board_poses.csv", "frame,board,x_m,y_m,z_m,qx,qy,qz,qw,num_cameras,num_corners,rms_px\n"
         "0,0,0.2,0,0.8,0,0.38,0,0.92,4,96,0.2\n5,0,-0.3,0.2,1.1,0,0,0,1,4,96,0.2\n")


def save_joints(run, names):
    bones = [[JOINTS.index(end) for end in bone] for bone in BONES]
    views = []
    for i, name in enumerate(names):
        save(run / f"pose3d/take1/joint-views/{i}.png", png(48, 64, lambda x, y: (90 + x, 90 + 20 * i, 90 + y)))
        joints = [[300 + 10 * j, 100 + 40 * j, 301.5 + 10 * j, 100.5 + 40 * j] for j in range(len(JOINTS))]
        views.append({"camera": name, "instant": 10, "frame": 10, "median_px": 1.6, "max_px": 1.6, "num_points": 7, "box_px": [200, 60, 300, 400],
                      "picture": f"joint-views/{i}.png", "joints": joints})
    save(run / "pose3d/take1/triangulate.result.json", result("triangulate", {
        "num_points": FRAMES * len(JOINTS), "status_counts": {"Ok": FRAMES * len(JOINTS) - 1, "LowParallax": 1}, "median_rms_px": 1.2,
        "cameras": [{"name": name, "mean_residual_px": [0.1 * i, -0.2]} for i, name in enumerate(names)],
        "overlays": {"bones": bones, "num_joints": len(JOINTS), "views": views}}, outputs=[("points.csv", "points")]))


def save_masks(run, names):
    for i, name in enumerate(names):
        save(run / f"masks/{i}.png", png(90, 60, lambda x, y: (40, 230, 40) if abs((x - 45) ** 2 + (y - 30) ** 2 - 400) < 40 else (120, 110, 100)))
    save(run / "masks/mask.result.json", result("mask", {
        "backend": "background", "cameras": len(names), "pictures": len(names) * FRAMES, "flicker": 1e-6,
        "per_camera": [{"name": name, "pictures": FRAMES, "empty": 0, "flicker": 1e-6} for name in names]},
        outputs=[(f"{i}.png", "overlay") for i in range(len(names))]))


def save_avatar(run, names, ssim=0.9, place="avatar"):
    pictures = []
    for k in range(3):
        strip = png(4 * 48 + 6, 48, lambda x, y: (0, 0, 0) if x % 50 >= 48 else (50 * (x // 50) + 40, 2 * y + 20 * k, (x * y) % 80))
        save(run / f"{place}/eval/view_{k:08d}.png", strip)
        pictures.append({"path": f"eval/view_{k:08d}.png", "camera": names[1], "frame": 40 + k, "ssim": ssim - 0.01 * k, "psnr_db": 27.0,
                         "panels": ["truth", "render", "error", "nearest_pose"]})
    save(run / f"{place}/avatar_eval.result.json", result("avatar eval", {
        "holdout": {"n": 3, "ssim": ssim, "psnr_db": 27.0, "mask_iou": 0.95, "ssim_ci95": [ssim - 0.005, ssim + 0.005], "fd": None},
        "per_camera": [{"name": names[1], "ssim": ssim, "psnr_db": 27.0, "mask_iou": 0.95}], "pictures": pictures, "protocol_sha256": "ab" * 32},
        outputs=[(p["path"], "heldout-picture") for p in pictures]))
    save(run / f"{place}/body_motion.bin", triangle_body())
    save(run / f"{place}/body_texture.bin", triangle_texture())
    save(run / f"{place}/player.bin", triangle_player())
    save(run / f"{place}/avatar_train.result.json", result("avatar train", {"method": "gaussians", "steps": 60}, outputs=[
        ("body_motion.bin", "body-motion"), ("body_texture.bin", "body-texture"), ("player.bin", "gaussians-player"), ("history.csv", "history")]))
    save(run / f"{place}/history.csv", "step,phase,total,ssim,wall_s\n" + "".join(f"{s},train,{1 / s},{1 - 1 / s},{s}\n" for s in range(1, 40)))


def triangle_body():
    """One triangle that one bone carries from frame 0 to 40 (report/page/body_file.h)."""
    still = (0, 0, 0, 32767, 0, 0, 0, 32767)
    return (b"MVBODY01" + struct.pack("<4I6f2i3I6f8h9H12B", 3, 1, 1, 2, -0.5, -0.5, 0, 0.5, 0.5, 1.8, 0, 40, 0, 1, 2, *[0] * 6, *still,
                                      0, 0, 0, 0, 65535, 0, 65535, 65535, 65535, *[0] * 12) + bytes((255, 0, 0, 0) * 3))


def triangle_texture():
    """Its colours (report/page/body_file.h): an image that is magenta all over."""
    image = png(8, 8, lambda x, y: (255, 0, 255))
    return b"MVBTEX01" + struct.pack("<3I3I6H3I", 3, 1, len(image), 0, 1, 2, 0, 0, 65535, 0, 0, 65535, 0, 1, 2) + image


def triangle_player():
    """One Gaussian on it at two time steps (report/page/player.h)."""
    mesh = (0, 0, 0, 0, 65535, 0, 65535, 65535, 65535)
    return b"MVGPLAY1" + struct.pack("<5I9f2i4I18H3H11B", 1, 1, 3, 2, 0, -0.5, -0.5, 0, 0.5, 0.5, 1.8, 0, 0, 1, 0, 40, 0, 1, 2, 0, *mesh, *mesh,
                                     16384, 16384, 32768, 230, 230, 230, 128, 128, 128, 255, 255, 230, 120, 40)


def make_run(folder, names=("front", "left", "back", "right"), ssim=0.9, avatar="avatar"):
    """Results of every stage in `folder`; `names`: of the cameras; `avatar`: the folder of the avatar."""
    save_calibration(folder, names)
    save_take(folder)
    save_joints(folder, names)
    save_masks(folder, names)
    save_avatar(folder, names, ssim, avatar)
    save(folder / "provenance.jsonl", json.dumps({"time": "2026-01-02T03:04:05Z", "command": "calibrate", "version": "0.2.0",
                                                   "argv": ["mvstudio", "calibrate", "--camera", "a=b c"], "exit": 0, "wall_s": 2}) + "\n")
    return folder


def make_study(folder):
    """The arguments of `report` that make the page of a user study of three images."""
    for k, name in enumerate(("one", "two", "truth")):
        for i in range(3):
            save(folder / f"{name}/left_{i:08d}.png", png(48, 48, lambda x, y: (5 * x, 4 * y, 60 * k + 20 * i)))
    return ("--study", f"one={folder}/one", f"two={folder}/two", "--truth", folder / "truth", "--out", folder / "study.html")


def make_dataset(folder, frames=4):
    """A dataset in the layout of CMU Panoptic: centimetres, y down; joints of nineteen, images that tell the camera by their colour."""
    cameras = []
    for i, camera in enumerate(rig(("00_00", "00_01", "00_02"))):
        lens = camera["intrinsics"]
        rows, t = matrix(camera["cam_from_world"]["rotation_xyzw"]), camera["cam_from_world"]["translation"]
        cameras.append({"name": camera["name"], "type": "hd", "resolution": list(SIZE), "panel": 0, "node": i,
                        "K": [[lens["fx"], 0, lens["cx"]], [0, lens["fy"], lens["cy"]], [0, 0, 1]], "distCoef": [0] * 5,
                        "R": [[row[0], -row[2], row[1]] for row in rows], "t": [[100 * v] for v in t]})
        for frame in range(frames):
            image = png_of_rows(*SIZE, (b"\0" + bytes(DATASET_COLOURS[i]) * SIZE[0]) * SIZE[1])
            save(folder / f"hdImgs/{camera['name']}/{camera['name']}_{frame:08d}.png", image)
    save(folder / "calibration_made.json", {"calibDataSource": "made", "cameras": cameras})
    for frame in range(frames):
        joints = []
        for k in range(19):
            x, y, z = joint_at(JOINTS[k % len(JOINTS)], frame)
            joints += [100 * x, -100 * z, 100 * y, 0.9]
        save(folder / f"hdPose3d_stage1_coco19/body3DScene_{frame:08d}.json", {"version": 0.7, "univTime": frame, "bodies": [{"id": 0, "joints19": joints}]})
    return folder


def matrix(q):
    """Rows of the rotation of a quaternion x, y, z, w."""
    x, y, z, w = q
    return ((1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)), (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
            (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)))


def make_session(folder, names):
    """A session with these results: footage of one take, an image a time step; masks of the first camera."""
    make_run(folder, names, avatar="avatar/take1")
    left, top, right, bottom = MASK_BOX
    row = lambda inside: b"\0" + b"".join(bytes(3 * (255 * (inside and left <= x < right),)) for x in range(SIZE[0]))
    mask = png_of_rows(*SIZE, b"".join(row(top <= y < bottom) for y in range(SIZE[1])))
    for frame in range(FRAMES):
        save(folder / f"masks/take1/{names[0]}/{frame:08d}.png", mask)
    for i, name in enumerate(names):
        image = png_of_rows(*SIZE, (b"\0" + bytes((90 + 20 * i, 100, 110)) * SIZE[0]) * SIZE[1])
        for frame in range(FRAMES):
            save(folder / f"raw/take1/{i}/{frame:06d}.png", image)
    toml = ['schema = "mvstudio.session/1"', 'units = "m"', "fps_hz = 25.0"]
    quoted = [json.dumps(name) for name in names]
    for name in quoted:
        toml += ["[[cameras]]", f"name = {name}", f"size_px = {list(SIZE)}"]
    toml += ["[[takes]]", 'name = "take1"', 'kind = "people"', "[takes.footage]"]
    save(folder / "mvstudio.toml", "\n".join(toml + [f'{name} = "raw/take1/{i}"' for i, name in enumerate(quoted)]) + "\n")
    return folder
