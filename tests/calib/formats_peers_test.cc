#include <gmock/gmock.h>
#include <gtest/gtest.h>

extern "C" {
#include <mrcal/mrcal.h>
}

#include <cstdlib>
#include <filesystem>
#include <memory>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "calib/formats/formats.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "tests/calib/format_samples.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test_data.h"

/// The files as the programs that they belong to read them: libmrcal, OpenCV and the program `colmap` are the oracles.
namespace mvstudio::calib {
namespace {

using Format = CalibrationFormat;
using geometry::LensModel;
using geometry::Rig;
using geometry::RigCamera;
using mvstudio::testing::DataRoot;
using mvstudio::testing::TempDir;
using testing::Carried;
using testing::ExpectSamePixels;
using testing::RandomRig;

struct FreeModel {
  void operator()(mrcal_cameramodel_t* model) const { mrcal_free_cameramodel(&model); }
};
using MrcalModel = std::unique_ptr<mrcal_cameramodel_t, FreeModel>;

/// World points all over the image, some of them far.
std::vector<Eigen::Vector3d> PointsSeenBy(const RigCamera& camera) {
  const geometry::Projector projector(camera.camera);
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < 80; ++k) {
    const Eigen::Vector2d px((k % 10 + 0.5) * camera.camera.width_px / 10, (k / 10 + 0.5) * camera.camera.height_px / 8);
    const geometry::Unprojection ray = projector.Unproject(px);
    if (ray.status != Status::kOk) continue;
    points.push_back(Inverse(camera.cam_from_world) * Eigen::Vector3d((0.5 + k % 7) * ray.ray_in_cam));
  }
  return points;
}

Eigen::Vector2d OurPixel(const RigCamera& camera, const Eigen::Vector3d& x_in_world) {
  return geometry::Project(camera.camera, camera.cam_from_world * x_in_world).px;
}

Eigen::Vector2d MrcalPixel(const mrcal_cameramodel_t& model, const Eigen::Vector3d& x_in_world) {
  mrcal_point3_t world{}, cam{};
  for (int i = 0; i < 3; ++i) world.xyz[i] = x_in_world[i];
  mrcal_transform_point_rt(cam.xyz, nullptr, nullptr, model.rt_cam_ref, world.xyz);
  mrcal_point2_t px{};
  EXPECT_TRUE(mrcal_project(&px, nullptr, nullptr, &cam, 1, &model.lensmodel, model.intrinsics));
  return {px.x, px.y};
}

void ExpectMrcalAgrees(const std::string& path, const RigCamera& camera, double tolerance_px) {
  SCOPED_TRACE(path);
  const MrcalModel model(mrcal_read_cameramodel_file(path.c_str()));
  ASSERT_TRUE(model);
  EXPECT_EQ(static_cast<int>(model->imagersize[0]), camera.camera.width_px);
  EXPECT_EQ(static_cast<int>(model->imagersize[1]), camera.camera.height_px);
  const std::vector<Eigen::Vector3d> points = PointsSeenBy(camera);
  EXPECT_GT(points.size(), 40u);
  for (const Eigen::Vector3d& x : points) {
    ASSERT_LT((MrcalPixel(*model, x) - OurPixel(camera, x)).norm(), tolerance_px) << x.transpose();
  }
}

TEST(Mrcal, ReadsWhatWeWrite) {
  const TempDir folder;
  const Rig rig = Carried(RandomRig(11), Format::kMrcal, [](const auto&) { return true; });
  WriteCalibration(rig, Format::kMrcal, folder / "models");
  for (const RigCamera& camera : rig.cameras) {
    ExpectMrcalAgrees(folder / ("models/" + camera.camera.name + ".cameramodel"), camera, 1e-9);
  }
}

TEST(Mrcal, WritesWhatWeRead) {
  const TempDir folder;
  const Rig rig = Carried(RandomRig(12), Format::kMrcal, [](const auto&) { return true; });
  WriteCalibration(rig, Format::kMrcal, folder / "ours");
  MakeFolder(folder / "theirs");
  for (const RigCamera& camera : rig.cameras) {
    const std::string file = "/" + camera.camera.name + ".cameramodel";
    const MrcalModel model(mrcal_read_cameramodel_file((folder / "ours" + file).c_str()));
    ASSERT_TRUE(model && mrcal_write_cameramodel_file((folder / "theirs" + file).c_str(), model.get()));
    // mrcal rounds its numbers to six decimals: the rounded ones are read alike.
    ExpectMrcalAgrees(folder / "theirs" + file, ReadMrcal({folder / "theirs" + file}).rig.cameras.at(0), 1e-9);
  }
}

TEST(Mrcal, RealModelsProjectAlike) {
  MVS_NEEDS_DATA("mrcal_figueroa");
  int num_splined = 0;
  for (const char* where : {"/mrcal_figueroa/test/data/", "/mrcal_figueroa/doc/data/figueroa-overpass-looking-S/"}) {
    for (const std::string& path : FilesMatching(DataRoot() + where + "*.cameramodel")) {
      EXPECT_EQ(DetectFormat(path), Format::kMrcal);
      const Rig rig = ReadMrcal({path}).rig;
      ASSERT_EQ(rig.cameras.size(), 1u);
      num_splined += rig.cameras[0].camera.model == LensModel::kSplined;
      ExpectMrcalAgrees(path, rig.cameras[0], 1e-9);
    }
  }
  EXPECT_EQ(num_splined, 4);
}

TEST(Mrcal, LensesThatAreNotOursAreNamed) {
  const TempDir folder;
  for (const char* lens : {"LENSMODEL_STEREOGRAPHIC", "LENSMODEL_CAHVOR", "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=11",
                           "LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=100000_Ny=100000_fov_x_deg=120"}) {
    WriteFileAtomic(folder / "a.cameramodel",
                    "{'lensmodel': '" + std::string(lens) +
                        "', 'intrinsics': [1,1,1,1], 'extrinsics': [0,0,0,0,0,0], 'imagersize': [4,3]}");
    const std::string message = mvstudio::testing::MessageOf<FormatError>([&] { ReadMrcal({folder / "a.cameramodel"}); });
    EXPECT_NE(message.find("lensmodel: the "), std::string::npos) << message;
  }
}

cv::Mat ReadMat(const cv::FileStorage& file, const std::string& key) {
  cv::Mat mat;
  file[key] >> mat;
  EXPECT_FALSE(mat.empty()) << key;
  return mat;
}

/// Every camera's points through cv::projectPoints or cv::fisheye::projectPoints.
void ExpectOpenCvAgrees(const RigCamera& camera, const cv::Mat& k, const cv::Mat& distortion, const cv::Mat& rotation,
                        const cv::Mat& translation) {
  cv::Mat rvec = rotation;
  if (rotation.total() == 9) cv::Rodrigues(rotation, rvec);
  std::vector<cv::Point3d> points;
  const std::vector<Eigen::Vector3d> seen = PointsSeenBy(camera);
  for (const Eigen::Vector3d& x : seen) points.emplace_back(x.x(), x.y(), x.z());
  std::vector<cv::Point2d> px;
  if (camera.camera.model == LensModel::kKannalaBrandt4) {
    cv::fisheye::projectPoints(points, px, rvec, translation, k, distortion);
  } else {
    cv::projectPoints(points, rvec, translation, k, distortion, px);
  }
  ASSERT_EQ(px.size(), seen.size());
  EXPECT_GT(px.size(), 40u);
  for (size_t i = 0; i < px.size(); ++i) {
    // cv::fisheye works with theta up to 90 degrees.
    if ((camera.cam_from_world * seen[i]).z() < 0.05) continue;
    ASSERT_LT((Eigen::Vector2d(px[i].x, px[i].y) - OurPixel(camera, seen[i])).norm(), 1e-8) << camera.camera.name;
  }
}

TEST(OpenCv, ProjectsWhatWeWriteAlike) {
  const TempDir folder;
  const Rig rig = Carried(RandomRig(13), Format::kOpenCvYaml, [](const auto&) { return true; });
  WriteCalibration(rig, Format::kOpenCvYaml, folder / "yaml");
  for (const RigCamera& camera : rig.cameras) {
    const cv::FileStorage file(folder / ("yaml/" + camera.camera.name + ".yml"), cv::FileStorage::READ);
    ASSERT_TRUE(file.isOpened());
    EXPECT_EQ(static_cast<int>(file["image_width"]), camera.camera.width_px);
    ExpectOpenCvAgrees(camera, ReadMat(file, "camera_matrix"), ReadMat(file, "distortion_coefficients"), ReadMat(file, "R"),
                       ReadMat(file, "T"));
  }
}

/// Files as OpenCV's own writer makes them, with the keys of its samples and of OpenPose.
TEST(OpenCv, ItsXmlIsRead) {
  const TempDir folder;
  const Rig rig = Carried(RandomRig(15), Format::kOpenCvYaml, [](const auto&) { return true; });
  WriteCalibration(rig, Format::kOpenCvYaml, folder / "yaml");
  for (const bool openpose : {false, true}) {
    std::vector<std::string> paths;
    for (const RigCamera& camera : rig.cameras) {
      const cv::FileStorage yaml(folder / ("yaml/" + camera.camera.name + ".yml"), cv::FileStorage::READ);
      paths.push_back(folder / (camera.camera.name + ".xml"));
      cv::FileStorage xml(paths.back(), cv::FileStorage::WRITE);
      xml << "image_width" << camera.camera.width_px << "image_height" << camera.camera.height_px;
      if (!yaml["fisheye_model"].empty()) xml << "fisheye_model" << 1;
      xml << "calibration_time"
          << "Fri Nov 27 15:00:00 2026";
      cv::Mat pose;
      cv::hconcat(ReadMat(yaml, "R"), ReadMat(yaml, "T"), pose);
      if (openpose) {
        xml << "CameraMatrix" << pose << "Intrinsics" << ReadMat(yaml, "camera_matrix");
      } else {
        xml << "camera_matrix" << ReadMat(yaml, "camera_matrix") << "R" << ReadMat(yaml, "R") << "T" << ReadMat(yaml, "T");
      }
      xml << (openpose ? "Distortion" : "distortion_coefficients") << ReadMat(yaml, "distortion_coefficients");
    }
    EXPECT_EQ(DetectFormat(paths[0]), Format::kOpenCvYaml);
    const Rig read = ReadCalibration(Format::kOpenCvYaml, paths, {}).rig;
    ASSERT_EQ(read.cameras.size(), rig.cameras.size());
    for (size_t c = 0; c < rig.cameras.size(); ++c) {
      const RigCamera& camera = rig.cameras[c];
      EXPECT_EQ(read.cameras[c].camera.name, camera.camera.name);
      for (const Eigen::Vector3d& point : {Eigen::Vector3d(0.1, -0.2, 3), Eigen::Vector3d(0, 0, 2)}) {
        const Eigen::Vector3d world = Inverse(camera.cam_from_world) * point;
        EXPECT_LT((OurPixel(read.cameras[c], world) - OurPixel(camera, world)).norm(), 1e-9) << camera.camera.name << openpose;
      }
    }
  }
}

TEST(OpenCv, ReadsOurEasyMocapFiles) {
  const TempDir folder;
  const Rig rig = Carried(RandomRig(14), Format::kEasyMocap, [](const auto&) { return true; });
  WriteCalibration(rig, Format::kEasyMocap, folder / "em");
  const cv::FileStorage intri(folder / "em/intri.yml", cv::FileStorage::READ),
      extri(folder / "em/extri.yml", cv::FileStorage::READ);
  ASSERT_TRUE(intri.isOpened() && extri.isOpened());
  EXPECT_EQ(intri["names"].size(), rig.cameras.size());
  EXPECT_EQ(static_cast<std::string>(intri["names"][0]), rig.cameras[0].camera.name);
  for (const RigCamera& camera : rig.cameras) {
    const std::string& name = camera.camera.name;
    for (const char* rotation : {"R_", "Rot_"}) {
      ExpectOpenCvAgrees(camera, ReadMat(intri, "K_" + name), ReadMat(intri, "dist_" + name), ReadMat(extri, rotation + name),
                         ReadMat(extri, "T_" + name));
    }
  }
}

TEST(Colmap, ProgramConvertsOurModels) {
  if (std::system("command -v colmap >/dev/null 2>&1") != 0) GTEST_SKIP() << "needs the program colmap";
  const TempDir folder;
  const Rig rig = Carried(RandomRig(15), Format::kColmap, [](const auto&) { return true; });
  const std::tuple<Format, const char*, const char*> trips[] = {{Format::kColmap, "bin", "TXT"},
                                                                {Format::kColmapText, "txt", "BIN"}};
  for (const auto& [format, name, other] : trips) {
    const std::string in = folder / name, out = folder / (std::string(name) + "_converted");
    WriteCalibration(rig, format, in);
    MakeFolder(out);
    const std::string command = "colmap model_converter --input_path '" + in + "' --output_path '" + out + "' --output_type " +
                                other + " >'" + folder.path() + "/log' 2>&1";
    ASSERT_EQ(std::system(command.c_str()), 0) << ReadFile(folder / "log");
    const Rig back = ReadCalibration(DetectFormat(out), {out}).rig;
    ASSERT_EQ(back.cameras.size(), rig.cameras.size());
    Rig sorted;
    for (const RigCamera& camera : rig.cameras)
      sorted.cameras.push_back(back.cameras.at(static_cast<size_t>(back.Find(camera.camera.name))));
    ExpectSamePixels(rig, sorted, 1e-9);
  }
}

/// A chain of Kalibr's own layout, numbers chosen by hand.
TEST(Kalibr, ConventionsByHand) {
  const TempDir folder;
  WriteFileAtomic(folder / "camchain.yaml", R"(cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.1, 0.02, 0.003, -0.004]
  distortion_model: radtan
  intrinsics: [500.0, 510.0, 320.0, 240.0]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
cam1:
  T_cam_imu:
  - [1.0, 0.0, 0.0, 5.0]
  - [0.0, 1.0, 0.0, 5.0]
  - [0.0, 0.0, 1.0, 5.0]
  - [0.0, 0.0, 0.0, 1.0]
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, -0.1]   # the left camera stands left
  - [0.0, 1.0, 0.0, 0.0]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: ds
  distortion_coeffs: []
  distortion_model: none
  intrinsics: [-0.2, 0.6, 317.0, 316.0, 724.0, 546.0]
  resolution: [1440, 1080]
  rostopic: /stereo/right/image_raw
cam2:
  T_cn_cnm1:
  - [0.0, -1.0, 0.0, 0.0]
  - [1.0, 0.0, 0.0, 0.2]
  - [0.0, 0.0, 1.0, 0.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: omni
  distortion_coeffs: [0.0, 0.0, 0.001, 0.002]
  distortion_model: radtan
  intrinsics: [0.8, 833.0, 830.0, 373.0, 253.0]
  resolution: [752, 480]
)");
  EXPECT_EQ(DetectFormat(folder / "camchain.yaml"), Format::kKalibr);
  const Rig rig = ReadKalibr(folder / "camchain.yaml").rig;
  ASSERT_EQ(rig.cameras.size(), 3u);
  EXPECT_EQ(rig.cameras[0].camera.model, LensModel::kBrown4);
  EXPECT_EQ(rig.cameras[1].camera.model, LensModel::kDoubleSphere);
  EXPECT_EQ(rig.cameras[1].camera.name, "cam1");
  EXPECT_EQ(rig.cameras[2].camera.model, LensModel::kUcmP);
  EXPECT_EQ(rig.cameras[1].camera.params, (Eigen::VectorXd(6) << 317, 316, 724, 546, -0.2, 0.6).finished());
  EXPECT_EQ(rig.cameras[2].camera.params, (Eigen::VectorXd(7) << 833, 830, 373, 253, 0.8, 0.001, 0.002).finished());
  EXPECT_LT((rig.cameras[1].cam_from_world * Eigen::Vector3d(0, 0, 2) - Eigen::Vector3d(-0.1, 0, 2)).norm(), 1e-15);
  EXPECT_LT((rig.cameras[2].cam_from_world * Eigen::Vector3d(0, 0, 2) - Eigen::Vector3d(0, 0.1, 2)).norm(), 1e-15);
  // Mei's model by its formula: the point over its norm, moved by xi along the axis, projected, decentred.
  const Eigen::Vector3d x = Eigen::Vector3d(0.3, -0.2, 1).normalized();
  const double a = x.x() / (x.z() + 0.8), b = x.y() / (x.z() + 0.8), r2 = a * a + b * b;
  const Eigen::Vector2d expected(833 * (a + 2 * 0.001 * a * b + 0.002 * (r2 + 2 * a * a)) + 373,
                                 830 * (b + 0.001 * (r2 + 2 * b * b) + 2 * 0.002 * a * b) + 253);
  EXPECT_LT((geometry::Project(rig.cameras[2].camera, 7 * x).px - expected).norm(), 1e-10);
}

TEST(Nerfstudio, ConventionsByHand) {
  const TempDir folder;
  WriteFileAtomic(folder / "transforms.json", R"({"fl_x": 500, "fl_y": 510, "cx": 320.5, "cy": 240.5, "w": 640, "h": 480,
    "k1": 0.1, "aabb_scale": 16, "frames": [{"file_path": "./images/left.jpg", "sharpness": 9.5,
    "transform_matrix": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]}]})");
  const Rig rig = ReadNerfstudio(folder.path()).rig;
  ASSERT_EQ(rig.cameras.size(), 1u);
  EXPECT_EQ(rig.cameras[0].camera.name, "left");
  EXPECT_EQ(rig.cameras[0].camera.params, (Eigen::VectorXd(8) << 500, 510, 320, 240, 0.1, 0, 0, 0).finished());
  EXPECT_LT((rig.cameras[0].CenterInWorld() - Eigen::Vector3d(1, 2, 3)).norm(), 1e-15);
  // OpenGL cameras look along -z with y up: a point below the axis in world is below it in the image too.
  EXPECT_LT((rig.cameras[0].cam_from_world * Eigen::Vector3d(1, 1, -1) - Eigen::Vector3d(0, 1, 4)).norm(), 1e-15);
}

TEST(EasyMocap, ReadsItsOwnLayout) {
  const TempDir folder;
  const std::string head = "%YAML:1.0\r\n---\r\nnames:\n  - \"01\"\n";
  const auto mat = [](const std::string& key, int rows, int cols, const std::string& data) {
    return key + ": !!opencv-matrix\n  rows: " + std::to_string(rows) + "\n  cols: " + std::to_string(cols) +
           "\n  dt: d\n  data: [" + data + "]\n";
  };
  WriteFileAtomic(folder / "intri.yml", head + mat("K_01", 3, 3, "900.000, 0.000, 512.000, 0, 901, 300, 0, 0, 1") +
                                            mat("dist_01", 1, 5, "-0.1, 0.2, 0.001, 0.002, 0.01"));
  WriteFileAtomic(folder / "extri.yml", head + mat("R_01", 3, 1, "0, 0, 1.5707963267948966") + mat("T_01", 3, 1, "1, 2, 3"));
  EXPECT_EQ(DetectFormat(folder.path()), Format::kEasyMocap);
  EXPECT_EQ(DetectFormat(folder / "intri.yml"), Format::kEasyMocap);
  EXPECT_THROW(ReadEasyMocap({folder.path()}), UsageError) << "no image size";
  ReadOptions options;
  options.width_px = 1024, options.height_px = 600;
  const Rig rig = ReadEasyMocap({folder / "extri.yml", folder / "intri.yml"}, options).rig;
  ASSERT_EQ(rig.cameras.size(), 1u);
  EXPECT_EQ(rig.cameras[0].camera.name, "01");
  EXPECT_EQ(rig.cameras[0].camera.model, LensModel::kBrown5);
  EXPECT_LT((rig.cameras[0].cam_from_world * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(), 1e-15);
}

TEST(Colmap, LensesByHand) {
  const TempDir folder;
  const auto read = [&](const std::string& camera) {
    WriteFileAtomic(folder / "cameras.txt", "# comment\n1 " + camera + "\n");
    WriteFileAtomic(folder / "images.txt", "1 1 0 0 0 1 2 3 1 sub/left.jpg\n10.5 20.5 -1 1 2 3\n");
    return ReadColmap(folder.path()).rig.cameras.at(0);
  };
  RigCamera camera = read("SIMPLE_RADIAL 640 480 500 320 240 0.1");
  EXPECT_EQ(camera.camera.name, "sub/left");
  EXPECT_EQ(camera.camera.params, (Eigen::VectorXd(5) << 500, 500, 319.5, 239.5, 0.1).finished());
  EXPECT_EQ(camera.cam_from_world.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(read("RADIAL 640 480 500 320 240 0.1 0.2").camera.model, LensModel::kBrown2);
  EXPECT_EQ(read("SIMPLE_PINHOLE 640 480 500 320 240").camera.model, LensModel::kPinhole);
  camera = read("RADIAL_FISHEYE 640 480 500 320 240 0.1 0.2");
  EXPECT_EQ(camera.camera.params, (Eigen::VectorXd(8) << 500, 500, 319.5, 239.5, 0.1, 0.2, 0, 0).finished());
  EXPECT_EQ(camera.camera.model, LensModel::kKannalaBrandt4);
  EXPECT_EQ(read("THIN_PRISM_FISHEYE 640 480 500 501 320 240 0.1 0.2 0 0 0.3 0.4 0 0").camera.params[7], 0.4);
  EXPECT_THROW(read("THIN_PRISM_FISHEYE 640 480 500 501 320 240 0.1 0.2 0 0 0.3 0.4 0.01 0"), FormatError);
  camera = read("SIMPLE_FISHEYE 640 480 500 320 240");
  EXPECT_EQ(camera.camera.model, LensModel::kKannalaBrandt4) << "equidistant, not a pinhole";
  EXPECT_EQ(camera.camera.params, (Eigen::VectorXd(8) << 500, 500, 319.5, 239.5, 0, 0, 0, 0).finished());
  EXPECT_EQ(read("FISHEYE 640 480 500 501 320 240").camera.params[1], 501);
  camera = read("EUCM 640 480 500 501 320 240 0.6 1.2");
  EXPECT_EQ(camera.camera.model, LensModel::kEucm);
  EXPECT_EQ(camera.camera.params, (Eigen::VectorXd(6) << 500, 501, 319.5, 239.5, 0.6, 1.2).finished());
  const std::string aria = "RAD_TAN_THIN_PRISM_FISHEYE 640 480 500 501 320 240 0.1 0.2 0.3 0.4 ";
  EXPECT_EQ(read(aria + "0 0 0 0 0 0 0 0").camera.params[7], 0.4);
  EXPECT_THROW(read(aria + "0 0 0.01 0 0 0 0 0"), FormatError);
  for (const char* name :
       {"DIVISION 640 480 500 501 320 240 0.1", "SIMPLE_DIVISION 640 480 500 320 240 0.1", "EQUIRECTANGULAR 640 480 640 480"})
    EXPECT_THAT(mvstudio::testing::MessageOf<FormatError>([&] { read(name); }), ::testing::HasSubstr("in COLMAP")) << name;
  EXPECT_THROW(read("FOV 640 480 500 501 320 240 0.9"), FormatError);
  EXPECT_THROW(read("OPENCV 640 480 500 501 320 240 0.9"), FormatError) << "too few";
  EXPECT_THROW(read("NONSENSE 640 480 500 501 320 240 0.9"), FormatError);
}

}  // namespace
}  // namespace mvstudio::calib
