"""A fitted body against its file and against skinning in NumPy; Gaussians against the images that `avatar eval` renders."""
import pickle

import mvstudio
import numpy as np
import PIL.Image
import pytest


@pytest.fixture(scope="module")
def body(dataset, tmp_path_factory):
    return mvstudio.Body.fit(dataset, out=tmp_path_factory.mktemp("fit") / "body", threads=2)


@pytest.fixture(scope="module")
def run(dataset, body, tmp_path_factory):
    """A run of Gaussians on the body's template, and what its evaluation rendered."""
    folder = tmp_path_factory.mktemp("run") / "run"
    mvstudio.command("avatar train", dataset, out=folder, method="gaussians", steps=20, size=48, gaussians=1500, colour_degree=0,
                     holdout_cameras="00_03", holdout_frames="4-5", threads=2)
    mvstudio.command("avatar eval", folder, features="gabor", threads=2)
    return folder


def rotation(xyzw):
    x, y, z, w = xyzw
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def skinned(body, pose):
    """Linear blend skinning, written out: each bone turns about its head, carried by its parent."""
    turns, places = [], []
    for bone, parent in enumerate(body.bone_parents):
        head, turn = body.bone_heads[bone], rotation(pose.rotations[bone])
        if parent < 0:
            turns.append(turn)
            places.append(head + pose.shift)
        else:
            turns.append(turns[parent] @ turn)
            places.append(turns[parent] @ (head - body.bone_heads[parent]) + places[parent])
    x = np.zeros((len(body.vertices), 3))
    for k in range(4):
        bones, weights = body.skin_bones[:, k], body.skin_weights[:, k]
        local = body.vertices - body.bone_heads[bones]
        x += weights[:, None] * (np.einsum("vij,vj->vi", np.array(turns)[bones], local) + np.array(places)[bones])
    return x


def test_arrays_are_the_files(body):
    file = np.load(body.path)
    np.testing.assert_array_equal(body.vertices, file["vertices"])
    np.testing.assert_array_equal(body.faces, file["faces"])
    np.testing.assert_array_equal(body.skin_weights, file["skin_weights"])
    assert body.textures.shape[0] == 24 and body.textures.dtype == np.uint8 and body.textures.std() > 5
    assert len(body.bone_names) == len(body.bone_parents) == len(body.bone_heads) and body.frames == list(range(6))
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(body)).vertices, body.vertices)


def test_poses_skin_the_surface(body):
    assert not body.moves
    for frame in (0, 5):
        pose = body.pose(frame)
        np.testing.assert_allclose(body.vertices_at(pose), skinned(body, pose), atol=2e-5)
    rest = mvstudio.Pose(np.zeros(3), np.tile([0, 0, 0, 1.0], (len(body.bone_names), 1)))
    np.testing.assert_allclose(body.vertices_at(rest), body.vertices, atol=1e-6)
    np.testing.assert_allclose(body.joints_at(rest), body.coco19, atol=1e-9)


def test_joints_pose_the_body(body, dataset):
    samples = mvstudio.Dataset(dataset, crop=64)
    joints = samples.joints_in_world[0]
    posed = body.joints_at(body.pose(joints=joints))
    error = np.linalg.norm(posed - joints, axis=1)
    assert np.nanmedian(error) < 0.03 and np.isfinite(joints).all(axis=1).sum() > 12


def test_render_covers_the_mask(body, dataset):
    samples = mvstudio.Dataset(dataset, crop=64)
    for sample in (samples[0], samples[len(samples) - 1]):
        image, cover = body.render(body.pose(sample.frame), sample.K, sample.cam_from_world, (64, 64))
        seen, truth = cover > 127, sample.mask > 0
        assert image.shape == (64, 64, 3) and (seen & truth).sum() / (seen | truth).sum() > 0.8
        assert np.abs(image[seen & truth].astype(float) - sample.image[seen & truth]).mean() < 40


def test_gaussians_render_what_the_evaluation_did(run, dataset):
    gaussians = mvstudio.Gaussians(run)
    assert len(gaussians) == gaussians.about["size"] > 100 and gaussians.about["size_px"] == 48
    samples = mvstudio.Dataset(dataset, crop=48).subset(cameras=["00_03"], frames=[4, 5])
    rendered = sorted((run / "eval/render").rglob("*.png"))
    assert len(rendered) == len(samples) == 2
    for sample, path in zip(samples, rendered):
        assert path.stem.endswith(f"{sample.frame:08d}")
        image, _ = gaussians.render(gaussians.body.pose(sample.frame), sample.K, sample.cam_from_world, (48, 48))
        truth = np.asarray(PIL.Image.open(path).convert("RGB"))
        assert np.abs(image.astype(int) - truth).max() <= 1 and truth.std() > 5


def test_dataset_crops_are_the_evaluations_truth(run, dataset):
    samples = mvstudio.Dataset(dataset, crop=48).subset(cameras=["00_03"], frames=[4, 5])
    for sample, path in zip(samples, sorted((run / "eval/truth").rglob("*.png"))):
        np.testing.assert_array_equal(np.asarray(PIL.Image.open(path).convert("RGB")), sample.image * (sample.mask[..., None] > 0))


def test_mistakes(body, run, tmp_path):
    rest = mvstudio.Pose(np.zeros(3), np.tile([0, 0, 0, 1.0], (len(body.bone_names), 1)))
    for mistake, words in [(lambda: mvstudio.Body(tmp_path), "body.npz"),
                           (lambda: body.pose(99), "holds poses of frames 0 to 5"),
                           (lambda: body.pose(), "a frame or joints"),
                           (lambda: body.pose(joints=np.full((19, 3), np.nan)), "do not determine the trunk"),
                           (lambda: body.vertices_at(mvstudio.Pose(np.zeros(3), np.zeros((2, 4)))), "2 rotations; the body has"),
                           (lambda: body.render(rest, np.zeros((3, 3)), np.eye(4), (8, 8)), "`K`: is no matrix of a camera"),
                           (lambda: mvstudio.Gaussians(tmp_path), "body.npz"),
                           (lambda: mvstudio.command("avatar fit", tmp_path, out=tmp_path / "out"), "calibration")]:
        with pytest.raises(mvstudio.Error, match=words):
            mistake()
    with pytest.raises(AttributeError, match="no 'joints'"):
        body.joints


def test_program_is_needed(monkeypatch):
    monkeypatch.setenv("MVSTUDIO_BIN", "/nowhere/mvstudio")
    with pytest.raises(mvstudio.Error, match="name the program in MVSTUDIO_BIN") as caught:
        mvstudio.command("version")
    assert caught.value.code == "MISSING-TOOL"
