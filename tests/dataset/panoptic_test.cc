#include "dataset/panoptic.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>

#include "core/error.h"
#include "tests/dataset/dataset_test_util.h"

namespace mvstudio::dataset {
namespace {

using nlohmann::json;

const char kBand2[] = "panoptic/160906_band2/calibration_160906_band2.json";
const char kBand2Poses[] = "panoptic/160906_band2/hdPose3d_stage1_coco19";

/// Panoptic's own formula in its own units: x_cam = R x + t.
TEST(Panoptic, CamerasKeepOrderNumbersAndPlace) {
  MVS_NEEDS_DATA(kBand2);
  const std::string path = DataFolder(kBand2);
  const json file = json::parse(ReadFile(path));
  const geometry::Rig rig = ReadPanopticCalibration(path);
  ASSERT_EQ(rig.cameras.size(), 520u);
  const Eigen::Vector3d x_cm(31.5, -140.25, 77.0);  // y down
  const Eigen::Vector3d x_in_world = Eigen::Vector3d(31.5, 77.0, 140.25) / 100;
  for (size_t i = 0; i < 520; ++i) {
    const json& c = file["cameras"][i];
    const geometry::RigCamera& camera = rig.cameras[i];
    EXPECT_EQ(camera.camera.name, c["name"]);
    EXPECT_EQ(camera.camera.model, geometry::LensModel::kBrown5);
    EXPECT_EQ(camera.camera.fx(), c["K"][0][0].get<double>());
    EXPECT_EQ(camera.camera.cy(), c["K"][1][2].get<double>());
    for (int k = 0; k < 5; ++k) EXPECT_EQ(camera.camera.params[4 + k], c["distCoef"][k].get<double>());
    const Eigen::Vector3d x_in_cam = camera.cam_from_world * x_in_world;
    for (int r = 0; r < 3; ++r) {
      double expected = c["t"][r][0];
      for (int k = 0; k < 3; ++k) expected += c["R"][r][k].get<double>() * x_cm[k];
      EXPECT_NEAR(100 * x_in_cam[r], expected, 2e-7) << camera.camera.name;  // R is orthonormal to 1e-10 only
    }
  }
}

TEST(Panoptic, CalibrationRoundTrip) {
  MVS_NEEDS_DATA(kBand2);
  const std::string path = DataFolder(kBand2);
  mvstudio::testing::TempDir folder;
  const geometry::Rig once = ReadPanopticCalibration(path);
  WritePanopticCalibration(once, folder / "calibration_b.json", "copy");
  const geometry::Rig twice = ReadPanopticCalibration(folder / "calibration_b.json");
  ASSERT_EQ(twice.cameras.size(), once.cameras.size());
  for (size_t i = 0; i < once.cameras.size(); ++i) {
    const geometry::RigCamera &a = once.cameras[i], &b = twice.cameras[i];
    EXPECT_EQ(a.camera.name, b.camera.name);
    EXPECT_EQ(a.camera.width_px, b.camera.width_px);
    EXPECT_EQ(a.camera.params, b.camera.params);
    EXPECT_EQ(a.cam_from_world.translation, b.cam_from_world.translation);
    EXPECT_LT((a.cam_from_world.rotation.coeffs() - b.cam_from_world.rotation.coeffs()).norm(), 1e-15);
  }
  const json original = json::parse(ReadFile(path)), copy = json::parse(ReadFile(folder / "calibration_b.json"));
  for (size_t i = 0; i < 520; ++i) {
    for (const char* key : {"name", "type", "resolution", "panel", "node", "K", "distCoef", "t"}) {
      EXPECT_EQ(original["cameras"][i][key], copy["cameras"][i][key]) << key;
    }
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(original["cameras"][i]["R"][r][c].get<double>(), copy["cameras"][i]["R"][r][c].get<double>(), 3e-10);
      }
    }
  }
}

TEST(Panoptic, BodySceneOfCmuReadsAndRoundTrips) {
  MVS_NEEDS_DATA(kBand2Poses);
  const std::string poses = DataFolder(kBand2Poses);
  mvstudio::testing::TempDir folder;
  for (const std::string& path : Glob(poses)) {
    const Body3dScene scene = ReadBody3dSceneFile(path);
    EXPECT_EQ(scene.people.size(), 3u);
    EXPECT_EQ(scene.fps_type, "hd_29_97");
    WriteBody3dScene(scene.people, scene.univ_time_ms, folder / "copy.json");
    const json original = json::parse(ReadFile(path)), copy = json::parse(ReadFile(folder / "copy.json"));
    EXPECT_EQ(original, copy) << path;
  }
}

/// Numbers aside, the bytes are those of CMU's writer (its line ends depend on the system it ran on).
TEST(Panoptic, BodySceneHasTheByteFormOfCmu) {
  MVS_NEEDS_DATA(kBand2Poses);
  const std::string poses = DataFolder(kBand2Poses);
  mvstudio::testing::TempDir folder;
  const std::string path = Glob(poses)[0];
  const Body3dScene scene = ReadBody3dSceneFile(path);
  WriteBody3dScene(scene.people, scene.univ_time_ms, folder / "copy.json");
  const auto form = [](const std::string& file) {
    std::string text = std::regex_replace(ReadFile(file), std::regex("\r"), "");
    return std::regex_replace(text, std::regex("-?[0-9]+(\\.[0-9]+)?(e-?[0-9]+)?([,\\]])"), "N$3");
  };
  EXPECT_EQ(form(path), form(folder / "copy.json"));
}

TEST(Panoptic, InvalidJointsAndEmptyScenes) {
  mvstudio::testing::TempDir folder;
  Coco19Pose pose;
  pose.valid[4] = true;
  pose.confidence[4] = 0.5;
  pose.x_in_world.col(4) << 0.123456789, -0.25, 1.5;
  WriteBody3dScene({{3, pose}}, -1, folder / "a.json");
  const json file = json::parse(ReadFile(folder / "a.json"));
  const auto& joints = file["bodies"][0]["joints19"];
  ASSERT_EQ(joints.size(), 76u);
  EXPECT_EQ(joints[0], 0);
  EXPECT_EQ(joints[3], -1);
  EXPECT_NEAR(joints[16].get<double>(), 12.3456789, 1e-12);
  EXPECT_NEAR(joints[17].get<double>(), -150, 1e-12);  // y is down
  EXPECT_NEAR(joints[18].get<double>(), -25, 1e-12);
  const auto people = ReadBody3dScene(folder / "a.json");
  EXPECT_FALSE(people.at(3).valid[0]);
  EXPECT_TRUE(people.at(3).valid[4]);
  WriteBody3dScene({}, 0, folder / "empty.json");
  EXPECT_TRUE(ReadBody3dScene(folder / "empty.json").empty());
}

TEST(Panoptic, TruncatedAndMutatedFilesAreFormatErrors) {
  MVS_NEEDS_DATA("person_a");
  const std::string person = DataFolder("person_a");
  mvstudio::testing::TempDir folder;
  const std::string calibration = person + "/calibration_person_a.json";
  const std::string pose = person + "/hdPose3d_stage1_coco19/body3DScene_00000000.json";
  for (int i = 0; i < 100; ++i) {
    Truncate(calibration, folder / "c.json", i / 100.0);
    EXPECT_THROW(ReadPanopticCalibration(folder / "c.json"), FormatError) << i;
    Truncate(pose, folder / "p.json", i / 100.0);
    EXPECT_THROW(ReadBody3dScene(folder / "p.json"), FormatError) << i;
  }
  WriteFileAtomic(folder / "deep.json", std::string(100000, '['));
  EXPECT_THROW(ReadPanopticCalibration(folder / "deep.json"), FormatError);
}

TEST(Panoptic, WrongFieldsAreNamed) {
  MVS_NEEDS_DATA("person_a");
  const std::string person = DataFolder("person_a");
  mvstudio::testing::TempDir folder;
  const json good = json::parse(ReadFile(person + "/calibration_person_a.json"));
  const auto where = [&](const std::function<void(json&)>& change) -> std::string {
    json bad = good;
    change(bad["cameras"][2]);
    WriteFileAtomic(folder / "c.json", bad.dump());
    try {
      ReadPanopticCalibration(folder / "c.json");
    } catch (const FormatError& error) {
      return error.where();
    }
    return "no error";
  };
  EXPECT_EQ(where([](json& c) { c["K"][1][2] = "x"; }), "cameras[2].K[1][2]");
  EXPECT_EQ(where([](json& c) { c["K"][0][1] = 0.5; }), "cameras[2].K");
  EXPECT_EQ(where([](json& c) { c.erase("t"); }), "cameras[2].t");
  EXPECT_EQ(where([](json& c) { c["distCoef"].erase(4); }), "cameras[2].distCoef");
  EXPECT_EQ(where([](json& c) {
              for (auto& v : c["R"][0]) v = -v.get<double>();
            }),
            "cameras[2].R");
  EXPECT_EQ(where([](json& c) { c["R"][0][0] = 3; }), "cameras[2].R");
  EXPECT_EQ(where([](json& c) { c["resolution"][0] = 0; }), "cameras[2].resolution");
  EXPECT_EQ(where([](json& c) { c["name"] = "00_01"; }), "cameras[2].name");
  EXPECT_EQ(where([](json& c) { c["name"] = "../up"; }), "cameras[2].name");
}

/// Every lens either keeps its projection through the file or is refused.
TEST(Panoptic, LensesBeyondFiveCoefficientsAreRefused) {
  mvstudio::testing::TempDir folder;
  geometry::Rig rig;
  geometry::RigCamera camera;
  camera.camera = geometry::MakePinhole("00_00", 640, 480, 500);
  int written = 0;
  for (const geometry::LensModel model : geometry::ModelsSimplestFirst()) {
    rig.cameras = {camera};
    geometry::Camera& lens = rig.cameras[0].camera;
    lens.model = model;
    lens.params = Eigen::VectorXd::Constant(NumParams(model), 0.01);
    lens.params.head<4>() = camera.camera.params;
    const bool fits = !IsWide(model) && NumParams(model) <= 9;
    if (!fits) {
      EXPECT_THROW(WritePanopticCalibration(rig, folder / "c.json", ""), UsageError) << ToString(model);
      continue;
    }
    ++written;
    WritePanopticCalibration(rig, folder / "c.json", "");
    const Eigen::Vector3d x(0.3, -0.2, 1.1);
    const geometry::Rig back = ReadPanopticCalibration(folder / "c.json");
    EXPECT_LT((Project(back.cameras[0].camera, x).px - Project(lens, x).px).norm(), 1e-12) << ToString(model);
  }
  EXPECT_EQ(written, 7);
  rig.cameras[0] = camera;
  rig.cameras[0].camera.name = "left";
  EXPECT_THROW(WritePanopticCalibration(rig, folder / "c.json", ""), ContractViolation);
}

TEST(Panoptic, OpensAForeignDataset) {
  MVS_NEEDS_DATA("person_a");
  const std::string person = DataFolder("person_a");
  const PanopticDataset dataset = OpenPanopticDataset(person);
  EXPECT_EQ(dataset.sequence, "person_a");
  EXPECT_EQ(dataset.rig.cameras.size(), 10u);
  EXPECT_EQ(dataset.frames.size(), 120u);
  EXPECT_EQ(dataset.Resolve("00_03"), "00_03");
  EXPECT_EQ(dataset.Resolve("cam_9"), "");
  EXPECT_TRUE(std::filesystem::exists(dataset.ImagePath("00_03", 119)));
  EXPECT_TRUE(std::filesystem::exists(dataset.MaskPath("00_03", 119)));
  const Coco19Pose& pose = dataset.poses.at(0).at(0);
  EXPECT_GT(pose.x_in_world(2, 1), 1.4);  // the nose is up
  EXPECT_THROW(OpenPanopticDataset(person + "/truth"), IoError);
}

}  // namespace
}  // namespace mvstudio::dataset
