#include "dataset/exports/read/layout_read.h"

#include "calib/formats/formats.h"
#include "core/disk/npy_write.h"
#include "dataset/exports/pickle.h"
#include "tests/exports/fixture.h"
#include "tests/support/message_of.h"
#include "tests/support/test.h"

/// Every export that holds cameras is read back; so are the datasets in whose layouts they are.
namespace mvstudio::exports::testing {
namespace {

namespace fs = std::filesystem;

constexpr double kSame = 1e-9;

/// As the commands do.
geometry::Rig ReadBack(const std::string& path, const calib::ReadOptions& options = {}) {
  const auto layout = DetectLayout(path);
  if (layout && calib::IsDatasetLayout(layout->format)) return ReadLayout(layout->format, layout->path, options).rig;
  const std::string file = layout ? layout->path : path;
  return calib::ReadCalibration(layout ? layout->format : calib::DetectFormat(file), {file}, options).rig;
}

/// The lens's pixel of a ray near the image's corner and the centre of projection, relative to the distance.
void ExpectSameCamera(const geometry::RigCamera& a, const geometry::RigCamera& b) {
  EXPECT_EQ(a.camera.name, b.camera.name);
  EXPECT_EQ(a.camera.width_px, b.camera.width_px);
  EXPECT_EQ(a.camera.height_px, b.camera.height_px);
  EXPECT_LT((a.camera.params.head(4) - b.camera.params.head(4)).norm(), kSame * a.camera.params.head(4).norm());
  const auto seen = [](const geometry::Camera& camera) {
    return geometry::Projector(camera).Project(Eigen::Vector3d(0.3, 0.2, 1)).px;
  };
  EXPECT_LT((seen(a.camera) - seen(b.camera)).norm(), kSame * seen(a.camera).norm());
  EXPECT_LT(geometry::RotationAngle(a.cam_from_world.rotation, b.cam_from_world.rotation), kSame);
  EXPECT_LT((a.cam_from_world.translation - b.cam_from_world.translation).norm(),
            kSame * (1 + b.cam_from_world.translation.norm()));
}

/// HuMMan's first camera is the world.
geometry::Rig InFirstCamera(geometry::Rig rig) {
  const geometry::Rigid3 world_from_first = Inverse(rig.cameras[0].cam_from_world);
  for (geometry::RigCamera& camera : rig.cameras) camera.cam_from_world = camera.cam_from_world * world_from_first;
  return rig;
}

void ExpectSameRig(const geometry::Rig& expected, const geometry::Rig& got, const std::string& format) {
  ASSERT_EQ(expected.cameras.size(), got.cameras.size());
  const geometry::Rig reference = format == "humman" ? InFirstCamera(expected) : expected;
  for (const geometry::RigCamera& camera : reference.cameras) {
    SCOPED_TRACE(camera.camera.name);
    const int found = got.Find(camera.camera.name);
    ASSERT_GE(found, 0);
    ExpectSameCamera(camera, got.cameras[static_cast<size_t>(found)]);
  }
}

bool HoldsJointsAlone(const std::string& format) {
  return format == "trc" || format == "c3d" || format == "bvh" || format == "csv";
}

/// With a lens where the format has one; of an undistorted export export.json states the pinhole.
geometry::Rig RigOfExport(const dataset::PanopticDataset& dataset, const std::string& folder) {
  geometry::Rig rig = dataset.rig;
  const auto manifest = nlohmann::json::parse(ReadFile(folder + "/export.json"));
  for (size_t i = 0; i < rig.cameras.size(); ++i) {
    const auto& entry = manifest["cameras"][i];
    geometry::Camera& lens = rig.cameras[i].camera;
    lens.model = *geometry::LensModelFromString(entry["model"].get<std::string>());
    const auto params = entry["params"].get<std::vector<double>>();
    lens.params = Eigen::Map<const Eigen::VectorXd>(params.data(), static_cast<Eigen::Index>(params.size()));
    lens.width_px = entry["size_px"][0], lens.height_px = entry["size_px"][1];
  }
  return rig;
}

TEST(Layouts, EveryExportWithCamerasIsReadBack) {
  const TempDir folder;
  for (const bool distorted : {false, true}) {
    Setting setting;
    setting.distorted = distorted, setting.odd_poses = distorted, setting.frames = {245};
    const std::string root = folder / (distorted ? "brown" : "pinhole");
    const dataset::PanopticDataset dataset = MakeDataset(root, setting);
    int read = 0;
    for (const FormatInfo& format : Formats()) {
      SCOPED_TRACE(format.name + (distorted ? " brown" : " pinhole"));
      const std::string out = root + "-" + format.name;
      ExportOptions options;
      options.hull_points = 0, options.undistort_view = dataset::UndistortView::kAll;
      ExportDataset(dataset, format.name, out, options);
      if (HoldsJointsAlone(format.name)) {
        EXPECT_THAT(MessageOf<FormatError>([&] { ReadBack(out); }), HasSubstr("joints and no cameras"));
      } else if (format.name == "ros") {
        EXPECT_THAT(MessageOf<FormatError>([&] { ReadBack(out); }), HasSubstr("no poses"));
      } else if (format.name == "mcap") {
        EXPECT_THAT(MessageOf<FormatError>([&] { ReadBack(out); }), HasSubstr("as messages"));
      } else {
        ExpectSameRig(RigOfExport(dataset, out), ReadBack(out), format.name);
      }
      ++read;
    }
    EXPECT_EQ(read, static_cast<int>(Formats().size()));
  }
}

TEST(Layouts, CamerasAloneAreReadBackWithNamesAndSizes) {
  const TempDir folder;
  geometry::Rig rig = MakeRig({});
  rig.cameras[0].camera.name = "left_eye";
  for (const FormatInfo& format : Formats()) {
    if (!format.rig_only || format.name == "ros") continue;
    SCOPED_TRACE(format.name);
    WriteRig(rig, format.name, folder / format.name);
    ExpectSameRig(rig, ReadBack(folder / format.name), format.name);
    const auto named = calib::CalibrationFormatFromString(format.name);
    if (named) ExpectSameRig(rig, ReadLayout(*named, folder / format.name, {}).rig, format.name);
  }
}

TEST(Layouts, SceneFilesKeepEveryLens) {
  const TempDir folder;
  geometry::Rig rig = MakeRig({});
  geometry::Camera& wide = rig.cameras[0].camera;
  wide.model = geometry::LensModel::kKannalaBrandt4;
  wide.params.conservativeResize(8);
  wide.params.tail(4) << 0.01, -0.002, 0.001, -0.0003;
  for (const std::string format : {"gltf", "ply"}) {
    WriteRig(rig, format, folder / format);
    ExpectSameRig(rig, ReadBack(folder / format), format);
    EXPECT_EQ(ReadBack(folder / format).cameras[0].camera.model, wide.model);
  }
}

TEST(Layouts, SeveralTimeStepsAreReadFromTheFirst) {
  const TempDir folder;
  const dataset::PanopticDataset dataset = MakeDataset(folder / "d", {});
  ExportOptions options;
  options.all_frames = true, options.hull_points = 0;
  for (const std::string format : {"colmap", "nerfstudio", "dynamic3dgs"}) {
    ExportDataset(dataset, format, folder / format, options);
    ExpectSameRig(dataset.rig, ReadBack(folder / format), format);
  }
}

/// annots.npy as other programs write it: lists of numbers, T as rows; no export.json beside it.
TEST(Layouts, ZjuOfOtherProgramsNeedsAnImageOrASize) {
  const TempDir folder;
  const PyValue k = PyValue::Array({2, 3, 3}, {900, 0, 511.5, 0, 901, 510, 0, 0, 1, 902, 0, 500, 0, 903, 520, 0, 0, 1});
  const PyValue d = PyValue::Array({2, 5, 1}, {-0.1, 0.2, 0, 0, 0, -0.1, 0.2, 1e-3, 0, 0.01});
  const PyValue r = PyValue::Array({2, 3, 3}, {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 1, 0, -1, 0, 0});
  const PyValue t = PyValue::Array({2, 3}, {10, 20, 3000, 0, 0, 2500});
  const PyValue ims =
      PyValue::Dict({{"ims", PyValue::List({PyValue::Text("Camera_B1/000000.jpg"), PyValue::Text("Camera_B2/000000.jpg")})}});
  const PyValue cams = PyValue::Dict({{"K", k}, {"D", d}, {"R", r}, {"T", t}});
  WriteFileAtomic(folder / "z/annots.npy", PyValue::Dict({{"cams", cams}, {"ims", PyValue::List({ims})}}).ToNpy());
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadBack(folder / "z"); }), HasSubstr("pass option 'size'"));
  calib::ReadOptions sized;
  sized.width_px = 1024, sized.height_px = 1000;
  const geometry::Rig rig = ReadBack(folder / "z", sized);
  ASSERT_EQ(rig.cameras.size(), 2u);
  EXPECT_EQ(rig.cameras[1].camera.name, "Camera_B2");
  EXPECT_NEAR(rig.cameras[0].cam_from_world.translation.z(), 3, 1e-15);
  EXPECT_EQ(rig.cameras[0].camera.model, geometry::LensModel::kBrown4);
  EXPECT_EQ(rig.cameras[1].camera.params[8], 0.01);
  dataset::WriteImage(Image(640, 480, 3), folder / "z/Camera_B1/000000.jpg");
  dataset::WriteImage(Image(320, 240, 3), folder / "z/Camera_B2/000000.jpg");
  EXPECT_EQ(ReadBack(folder / "z/annots.npy").cameras[1].camera.width_px, 320);
  sized.metres_per_unit = 1e-3;
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadBack(folder / "z", sized); }), HasSubstr("unit of its own"));
}

TEST(Layouts, WhatIsDamagedOrNotMeantIsRefusedByName) {
  const TempDir folder;
  const auto message = [&](const std::string& name, const std::string& bytes) {
    WriteFileAtomic(folder / name, bytes);
    return MessageOf<FormatError>([&] { ReadBack(folder / name); });
  };
  const std::string annots =
      PyValue::Dict({{"cams", PyValue::Dict({{"K", PyValue::Array({1, 3, 3}, std::vector<double>(9, 1))}})}}).ToNpy();
  EXPECT_THAT(message("a.npy", annots), HasSubstr("cams.D: is missing"));
  EXPECT_THAT(message("b.npy", annots.substr(0, annots.size() / 2)), HasSubstr("b.npy"));
  EXPECT_THAT(message("c.npy", NpyOfDoubles({3}, {1, 2, 3})), HasSubstr("array of numbers"));
  EXPECT_THAT(message("poses.npz", NpzOf({{"poses", NpyOfDoubles({1}, {0})}})), HasSubstr("camera_names: is missing"));
  EXPECT_THAT(message("cloud.ply", "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n"), HasSubstr("holds no cameras"));
  EXPECT_THAT(message("x.glb", std::string("glTF\x02\0\0\0", 8)), HasSubstr("cut short"));
  EXPECT_THAT(
      message("y.gltf", R"({"asset": {"version": "2.0"}, "cameras": [{"type": "perspective", "perspective": {"yfov": 1}}],
                                    "nodes": [{"children": [0]}], "scenes": [{"nodes": [0]}]})"),
      HasSubstr("in circles"));
  EXPECT_THAT(message("calibration.csv", "name,w,h,rx,ry,rz,tx,ty,tz,fx,fy,px\na,1,1,0,0,0,0,0,0,1,1,1\n"), HasSubstr("py"));
  EXPECT_THAT(message("m.bvh", "HIERARCHY\n"), HasSubstr("joints and no cameras"));
  EXPECT_THAT(message("d.smc", "\x89HDF\r\n\x1a\nrest"), HasSubstr("no readable HDF5"));
}

TEST(Layouts, CamerasOfDynamic3dgsThatMoveAreRefused) {
  const TempDir folder;
  const std::string k = "[[100,0,50],[0,100,40],[0,0,1]]", at = "[[1,0,0,0],[0,1,0,0],[0,0,1,";
  const auto meta = [&](const std::string& z) {
    return "{\"w\":100,\"h\":80,\"k\":[[" + k + "],[" + k + "]],\"w2c\":[[" + at + "3],[0,0,0,1]]],[" + at + z +
           "],[0,0,0,1]]]],\"fn\":[[\"0/000000.jpg\"],[\"0/000001.jpg\"]],\"cam_id\":[[0],[0]]}";
  };
  WriteFileAtomic(folder / "still/train_meta.json", meta("3"));
  const geometry::Rig rig = ReadBack(folder / "still");
  ASSERT_EQ(rig.cameras.size(), 1u);
  EXPECT_EQ(rig.cameras[0].camera.cx(), 49.5);
  WriteFileAtomic(folder / "moves/train_meta.json", meta("4"));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadBack(folder / "moves"); }), HasSubstr("cameras stand still"));
}

TEST(Layouts, GltfOfOtherProgramsIsReadByItsStandard) {
  const TempDir folder;
  WriteFileAtomic(folder / "scene.gltf",
                  R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
                      "cameras": [{"type": "perspective", "perspective": {"yfov": 0.9272952180016122, "aspectRatio": 1.5, "znear": 0.1}}],
                      "nodes": [{"scale": [2, 2, 2], "translation": [0, 1, 0], "children": [1]},
                                {"name": "front", "camera": 0, "translation": [0, 0.5, 3]}]})");
  calib::ReadOptions sized;
  sized.width_px = 300, sized.height_px = 200;
  const geometry::RigCamera camera = ReadBack(folder / "scene.gltf", sized).cameras.at(0);
  EXPECT_EQ(camera.camera.name, "front");
  EXPECT_NEAR(camera.camera.fy(), 200, 1e-9);  // tan(yfov / 2) = 0.5
  EXPECT_NEAR(camera.camera.fx(), 200, 1e-9);
  EXPECT_LT((camera.CenterInWorld() - Eigen::Vector3d(0, -6, 2)).norm(), 1e-12);  // y up to z up
  EXPECT_LT((camera.cam_from_world * Eigen::Vector3d(0, 0, 2) - Eigen::Vector3d(0, 0, 6)).norm(), 1e-12);
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadBack(folder / "scene.gltf"); }), HasSubstr("'size'"));
  sized.width_px = 400;
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadBack(folder / "scene.gltf", sized); }), HasSubstr("aspectRatio"));
  std::string old = ReadFile(folder / "scene.gltf");
  old.replace(old.find("\"2.0\""), 5, "\"1.0\"");
  WriteFileAtomic(folder / "old.gltf", old);
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadBack(folder / "old.gltf", sized); }), HasSubstr("is 1.0; glTF 2.0 is read"));
}

}  // namespace
}  // namespace mvstudio::exports::testing
