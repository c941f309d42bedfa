"""Joint angles of a take, against the angle between its own joints."""
import json

import conftest  # noqa: F401  (where mvstudio is)
import mvstudio
import numpy as np
import pytest


def take_of(folder, frames, rate_hz):
    """The take of one person in a folder: its joints by name, frame by frame, sigmas of 2 mm."""
    rows, covariances = ["frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m"], ["frame,person,joint,xx,xy,xz,yy,yz,zz"]
    for frame, joints in enumerate(frames):
        for name, x in joints.items():
            rows.append(f"{frame},0,{name},Ok,{float(x[0])},{float(x[1])},{float(x[2])},4,0.3,0.002")
            covariances.append(f"{frame},0,{name},4e-6,0,0,4e-6,0,4e-6")
    (folder / "points.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "covariance.csv").write_text("\n".join(covariances) + "\n", encoding="utf-8")
    about = {"schema": "mvstudio.pose3d/1", "skeleton": "body25", "points": "points.csv", "covariance": "covariance.csv",
             "frame_rate_hz": rate_hz, "world": "right-handed, z up"}
    (folder / "pose3d.json").write_text(json.dumps(about), encoding="utf-8")
    return mvstudio.Take(folder)


@pytest.fixture(scope="module")
def squats(tmp_path_factory):
    """A person whose left knee bends from 20 to 110 degrees while the right one stays at 30; body25's names."""
    bends = np.radians(np.linspace(20, 110, 31))
    trunk = {"MidHip": [0, 0, 1], "RHip": [0, -0.1, 1], "LHip": [0, 0.1, 1], "Neck": [0, 0, 1.5], "RShoulder": [0, -0.2, 1.5],
             "LShoulder": [0, 0.2, 1.5], "Nose": [0.1, 0, 1.65]}
    frames = []
    for bend in bends:
        joints = dict(trunk)
        for side, hip, angle in (("L", trunk["LHip"], bend), ("R", trunk["RHip"], np.radians(30))):
            knee = np.array(hip) + 0.4 * np.array([np.sin(0.5 * angle), 0, -np.cos(0.5 * angle)])
            joints[side + "Knee"] = knee
            joints[side + "Ankle"] = knee + 0.4 * np.array([-np.sin(0.5 * angle), 0, -np.cos(0.5 * angle)])
        frames.append(joints)
    return take_of(tmp_path_factory.mktemp("squats"), frames, 30)


STRIDE_S, STANCE, SPEED_M_S, RATE_HZ = 1.1, 0.62, 1.3, 100


def foot_at(time_s, phase):
    """(ahead, up, pitch): a foot that stands from its strike on for STANCE of the stride, then swings a stride's length ahead."""
    cycle = time_s / STRIDE_S + phase
    share, length = cycle % 1, SPEED_M_S * STRIDE_S
    ahead = (cycle // 1 - phase + 0.3) * length
    if share < STANCE:
        return ahead, 0.0, 0.5 * max(0, share - 0.4) / (STANCE - 0.4)
    s = (share - STANCE) / (1 - STANCE)
    return ahead + length * (s - np.sin(2 * np.pi * s) / (2 * np.pi)), 0.08 * np.sin(np.pi * s) ** 2, 0.5 * (1 - s) ** 2


@pytest.fixture(scope="module")
def walk(tmp_path_factory):
    """Six seconds along +y with known contacts."""
    frames = []
    for frame in range(600):
        way = SPEED_M_S * frame / RATE_HZ
        joints = {"MidHip": (0, way, 0.95), "LHip": (-0.1, way, 0.95), "RHip": (0.1, way, 0.95), "Neck": (0, way, 1.5)}
        for side, x, phase in (("L", -0.1, 0.0), ("R", 0.1, 0.5)):
            ahead, up, pitch = foot_at(frame / RATE_HZ, phase)
            joints[side + "Heel"] = (x, ahead + 0.2 * (1 - np.cos(pitch)), up + 0.2 * np.sin(pitch) + 0.03)
            joints[side + "BigToe"] = (x, ahead + 0.2, up + 0.03)
            joints[side + "Ankle"] = (x, ahead + 0.04, up + 0.1)
        frames.append(joints)
    return take_of(tmp_path_factory.mktemp("walk"), frames, RATE_HZ)


def test_knee_flexion_is_the_angle_between_its_bones(squats):
    table = squats.angles()
    assert list(table) == ["frame", "time_s", "angle", "value_deg", "sigma_deg", "status"]
    knee = table["angle"] == "knee_flexion_l"
    np.testing.assert_array_equal(table["frame"][knee], squats.frames)
    np.testing.assert_allclose(table["time_s"][knee], squats.frames / 30, atol=1e-6)
    thigh, shank = squats.joint("LKnee") - squats.joint("LHip"), squats.joint("LAnkle") - squats.joint("LKnee")
    cosine = (thigh * shank).sum(axis=1) / np.linalg.norm(thigh, axis=1) / np.linalg.norm(shank, axis=1)
    np.testing.assert_allclose(table["value_deg"][knee], np.degrees(np.arccos(cosine)), atol=0.01)
    assert (table["sigma_deg"][knee] > 0.1).all() and (table["sigma_deg"][knee] < 2).all() and (table["status"][knee] == "Ok").all()
    ankle = table["angle"] == "ankle_dorsiflexion_l"
    assert np.isnan(table["value_deg"][ankle]).all() and (table["status"][ankle] == "MissingJoint").all()


def test_angles_become_a_table_of_pandas(squats):
    pandas = pytest.importorskip("pandas", reason="needs python3-pandas")
    table = pandas.DataFrame(squats.angles())
    spans = table.groupby("angle").value_deg.agg(lambda value: value.max() - value.min())
    assert spans["knee_flexion_l"] == pytest.approx(90, abs=0.1) and spans["knee_flexion_r"] == pytest.approx(0, abs=0.1)


def test_gait_events_are_the_contacts(walk, squats):
    pandas = pytest.importorskip("pandas", reason="needs python3-pandas")
    table = pandas.DataFrame(walk.events())
    assert list(table) == ["frame", "time_s", "side", "event", "confidence", "velocity_frame"]
    assert table.groupby("event").size().min() >= 8 and set(table.side) == {"left", "right"}
    share = np.where(table.event == "heel_strike", 0, STANCE) - np.where(table.side == "left", 0, 0.5)
    cycles = table.time_s / STRIDE_S - share
    assert (np.abs(cycles - cycles.round()) * STRIDE_S < 0.08).all()
    np.testing.assert_allclose(table.time_s, table.frame / RATE_HZ)
    standing = squats.events()
    assert list(standing) == list(table) and all(len(column) == 0 for column in standing.values())
    with pytest.raises(mvstudio.Error, match="no person 3; it has \\[0\\]"):
        walk.events(3)


def test_arrays_are_the_tables(tmp_path):
    """Two persons, frames with gaps, joints that are missing or were not looked for, in pandas's reading."""
    draw = np.random.default_rng(8)
    pandas = pytest.importorskip("pandas", reason="needs python3-pandas")
    rows = pandas.DataFrame([(frame, person, joint) for frame in (3, 4, 9) for person in (0, 2) for joint in ("nose", "LHip", "RHip")],
                            columns=["frame", "person", "joint"])
    rows["status"] = draw.choice(["Ok", "TooFewViews"], len(rows))
    for name in ("x_m", "y_m", "z_m", "rms_px", "sigma_m"):
        rows[name] = np.where(rows.status == "Ok", draw.normal(size=len(rows)), np.nan)
    rows["num_views"] = draw.integers(0, 5, len(rows))
    rows = rows.drop(5)[["frame", "person", "joint", "status", "x_m", "y_m", "z_m", "num_views", "rms_px", "sigma_m"]]
    rows.to_csv(tmp_path / "points.csv", index=False)
    covariance = rows[rows.status == "Ok"][["frame", "person", "joint"]].assign(**{k: draw.normal(size=(rows.status == "Ok").sum())
                                                                                  for k in ("xx", "xy", "xz", "yy", "yz", "zz")})
    covariance.to_csv(tmp_path / "covariance.csv", index=False)
    take = mvstudio.Take(tmp_path)
    assert take.frames.tolist() == [3, 4, 9] and take.persons == [0, 2] and take.joints == ["nose", "LHip", "RHip"]
    shown = take.to_frame()
    pandas.testing.assert_frame_equal(shown, rows.drop(columns="rms_px").reset_index(drop=True)[list(shown.columns)], check_dtype=False)
    assert (take.status == "").sum() == 1 and np.isfinite(take.covariance).all(axis=(3, 4)).sum() == len(covariance)
    for row in covariance.itertuples():
        at = [3, 4, 9].index(row.frame), [0, 2].index(row.person), take.joints.index(row.joint)
        np.testing.assert_array_equal(take.covariance[at], [[row.xx, row.xy, row.xz], [row.xy, row.yy, row.yz], [row.xz, row.yz, row.zz]])


@pytest.mark.parametrize("text, said", [("frame,person\n", None), ("frame,person,joint\n0,0,a\n", "'x_m'"), ("a,b\n1,2\n1\n", "is no table")])
def test_tables_that_are_none(tmp_path, text, said):
    (tmp_path / "points.csv").write_text(text, encoding="utf-8")
    if said is None:
        assert len(mvstudio.Take(tmp_path)) == 0
        return
    with pytest.raises(mvstudio.Error, match=said) as caught:
        mvstudio.Take(tmp_path)
    assert caught.value.code == "INPUT-FORMAT"
    with pytest.raises(mvstudio.Error, match="expected a folder that triangulate wrote"):
        mvstudio.Take(tmp_path / "nothing")


def test_filtered_is_what_the_program_writes(walk, tmp_path):
    smooth = walk.filtered(filter="butterworth:6Hz", fill=5)
    mvstudio.command("markers", walk.folder, to="csv", filter="butterworth:6Hz", fill=5, out=tmp_path / "markers")
    pandas = pytest.importorskip("pandas", reason="needs python3-pandas")
    table = pandas.read_csv(tmp_path / "markers/person0.csv", float_precision="round_trip")
    for name in ("LHeel", "MidHip"):
        rows = table[table.joint == name]
        np.testing.assert_array_equal(smooth.joint(name), rows[["x_m", "y_m", "z_m"]])
        assert 1e-6 < np.abs(smooth.joint(name) - walk.joint(name)).max() < 0.1 or name == "MidHip"
    assert smooth.sigma_m.shape == walk.sigma_m.shape and np.isfinite(smooth.sigma_m).all()
    pandas = pytest.importorskip("pandas", reason="needs python3-pandas")
    angles = pandas.DataFrame(smooth.angles())
    alike = pandas.DataFrame(walk.angles(filter="butterworth:6Hz", fill=5))
    pandas.testing.assert_frame_equal(angles, alike)


def test_filtered_fills_gaps(tmp_path):
    frames = [{"nose": (0.01 * k, 0, 1.5), "MidHip": (0.01 * k, 0, 1)} for k in range(40)]
    for k in (20, 21):
        del frames[k]["nose"]
    take = take_of(tmp_path, frames, 50)
    full = take.filtered(fill=4)
    assert np.isnan(take.joint("nose")[20:22]).all()
    np.testing.assert_allclose(full.joint("nose")[:, 0], 0.01 * np.arange(40), atol=1e-6)
    assert (full.status[20:22, 0, full.joints.index("nose")] != "Ok").all()
