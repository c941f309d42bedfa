"""Joint angles of a take, against the angle between its own joints."""
import json

import conftest  # noqa: F401  (where mvstudio is)
import mvstudio
import numpy as np
import pandas
import pytest


@pytest.fixture(scope="module")
def squats(tmp_path_factory):
    """A person whose left knee bends from 20 to 110 degrees while the right one stays at 30; body25's names."""
    folder = tmp_path_factory.mktemp("squats")
    bends = np.radians(np.linspace(20, 110, 31))
    trunk = {"MidHip": [0, 0, 1], "RHip": [0, -0.1, 1], "LHip": [0, 0.1, 1], "Neck": [0, 0, 1.5], "RShoulder": [0, -0.2, 1.5],
             "LShoulder": [0, 0.2, 1.5], "Nose": [0.1, 0, 1.65]}
    rows, covariances = ["frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m"], ["frame,person,joint,xx,xy,xz,yy,yz,zz"]
    for frame, bend in enumerate(bends):
        joints = dict(trunk)
        for side, hip, angle in (("L", trunk["LHip"], bend), ("R", trunk["RHip"], np.radians(30))):
            knee = np.array(hip) + 0.4 * np.array([np.sin(0.5 * angle), 0, -np.cos(0.5 * angle)])
            joints[side + "Knee"] = knee
            joints[side + "Ankle"] = knee + 0.4 * np.array([-np.sin(0.5 * angle), 0, -np.cos(0.5 * angle)])
        for name, x in joints.items():
            rows.append(f"{frame},0,{name},Ok,{float(x[0])},{float(x[1])},{float(x[2])},4,0.3,0.002")
            covariances.append(f"{frame},0,{name},4e-6,0,0,4e-6,0,4e-6")
    (folder / "points.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    (folder / "covariance.csv").write_text("\n".join(covariances) + "\n", encoding="utf-8")
    about = {"schema": "mvstudio.pose3d/1", "skeleton": "body25", "points": "points.csv", "covariance": "covariance.csv",
             "frame_rate_hz": 30, "world": "right-handed, z up"}
    (folder / "pose3d.json").write_text(json.dumps(about), encoding="utf-8")
    return mvstudio.Take(folder)


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
    table = pandas.DataFrame(squats.angles())
    spans = table.groupby("angle").value_deg.agg(lambda value: value.max() - value.min())
    assert spans["knee_flexion_l"] == pytest.approx(90, abs=0.1) and spans["knee_flexion_r"] == pytest.approx(0, abs=0.1)
