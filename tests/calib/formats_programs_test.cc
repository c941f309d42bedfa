#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>

#include "calib/formats/formats.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// Files of programs for visual odometry and of other calibrators: their own formulas, written out here, are the oracle.
namespace mvstudio::calib {
namespace {

using geometry::LensModel;
using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;

ImportedRig ReadProgramFile(const std::string& text, CalibrationFormat format, const ReadOptions& options = {},
                            const std::string& name = "cam.yaml") {
  const TempDir folder;
  WriteFileAtomic(folder / name, text);
  EXPECT_EQ(DetectFormat(folder / name), format) << text.substr(0, 80);
  return ReadCalibration(format, {folder / name}, options);
}

std::string RefusedFile(const std::string& text, CalibrationFormat format, const ReadOptions& options = {}) {
  return MessageOf<FormatError>([&] { ReadProgramFile(text, format, options); });
}

constexpr CalibrationFormat kCv = CalibrationFormat::kOpenCvYaml, kKalibr = CalibrationFormat::kKalibr;

const Eigen::Vector3d kPoint(0.4, -0.3, 0.9);  ///< in the camera

Eigen::Vector2d PixelOf(const geometry::Rig& rig, size_t camera = 0) {
  return geometry::Project(rig.cameras[camera].camera, kPoint).px;
}

void ExpectPixel(const geometry::Rig& rig, double u, double v, size_t camera = 0) {
  EXPECT_LT((PixelOf(rig, camera) - Eigen::Vector2d(u, v)).norm(), 1e-9) << PixelOf(rig, camera).transpose();
}

void ExpectCentre(const geometry::Rig& rig, size_t camera, double x, double y, double z) {
  EXPECT_LT((rig.cameras[camera].CenterInWorld() - Eigen::Vector3d(x, y, z)).norm(), 1e-9);
}

constexpr char kVinsHead[] = "%YAML:1.0\n---\ncamera_name: camera\nimage_width: 752\nimage_height: 480\nmodel_type: ";
const std::string kMeiLens =
    "mirror_parameters:\n   xi: 1.5\nprojection_parameters:\n   gamma1: 900\n   gamma2: 890\n   u0: 369\n   v0: 250\n";
const std::string kVinsPinhole =
    "PINHOLE\ndistortion_parameters:\n   k1: -0.1\n   k2: 0.02\n   p1: 0.001\n   p2: -0.002\n"
    "projection_parameters:\n   fx: 461\n   fy: 460\n   cx: 362\n   cy: 248\n";

std::string CvMatrix(const std::string& key, int rows, int cols, const std::string& data) {
  return key + ": !!opencv-matrix\n   rows: " + std::to_string(rows) + "\n   cols: " + std::to_string(cols) +
         "\n   dt: d\n   data: [" + data + "]\n";
}

TEST(Vins, LensesOfCamodocal) {
  const double r = kPoint.head<2>().norm(), t = std::atan2(r, kPoint.z()), d = kPoint.norm();
  const double radius = t + 0.01 * std::pow(t, 3) - 0.02 * std::pow(t, 5) + 0.003 * std::pow(t, 7) - 0.0001 * std::pow(t, 9);
  const std::string fisheye =
      "KANNALA_BRANDT\nprojection_parameters:\n   k2: 0.01\n   k3: -0.02\n   k4: 0.003\n   k5: -0.0001\n   mu: 461\n   mv: "
      "460\n"
      "   u0: 362\n   v0: 248\n";
  ExpectPixel(ReadProgramFile(kVinsHead + fisheye, kCv).rig, 362 + 461 * radius * kPoint.x() / r,
              248 + 460 * radius * kPoint.y() / r);

  const double x = kPoint.x() / (kPoint.z() + 1.5 * d), y = kPoint.y() / (kPoint.z() + 1.5 * d);
  const std::string plain = "MEI\n" + kMeiLens + "distortion_parameters:\n   k1: 0\n   k2: 0\n   p1: 0\n   p2: 0\n";
  ExpectPixel(ReadProgramFile(kVinsHead + plain, kCv).rig, 369 + 900 * x, 250 + 890 * y);
  const std::string bent = "MEI\n" + kMeiLens + "distortion_parameters:\n   k1: -0.07\n   k2: 0.4\n   p1: 0\n   p2: 0\n";
  EXPECT_THAT(RefusedFile(kVinsHead + bent, kCv), HasSubstr("MEI with k1 and k2"));

  const double u = kPoint.x() / kPoint.z(), v = kPoint.y() / kPoint.z(), r2 = u * u + v * v;
  const double radial = 1 - 0.1 * r2 + 0.02 * r2 * r2;
  ExpectPixel(ReadProgramFile(kVinsHead + kVinsPinhole, kCv).rig,
              362 + 461 * (u * radial + 2 * 0.001 * u * v - 0.002 * (r2 + 2 * u * u)),
              248 + 460 * (v * radial + 0.001 * (r2 + 2 * v * v) - 2 * 0.002 * u * v));
  EXPECT_THAT(RefusedFile(std::string(kVinsHead) + "SCARAMUZZA\npoly_parameters:\n   p0: -220\n", kCv),
              HasSubstr("SCARAMUZZA"));
  EXPECT_THAT(
      RefusedFile(std::string(kVinsHead) + "SPHERE\nprojection_parameters:\n   fx: 1\ndistortion_parameters:\n   k1: 0\n", kCv),
      HasSubstr("'SPHERE'"));
}

/// body_T_cam of VINS-Fusion and extrinsicRotation of VINS-Mono are body from camera.
TEST(Vins, PosesOfTheSettings) {
  const std::string rotated = "0, -1, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1";
  const TempDir folder;
  for (const char* name : {"left.yaml", "right.yaml"}) WriteFileAtomic(folder / name, kVinsHead + kVinsPinhole);
  const std::string settings = "%YAML:1.0\n\nimu: 1\nnum_of_cam: 2\ncam0_calib: \"left.yaml\"\ncam1_calib: \"right.yaml\"\n";
  const std::string poses = CvMatrix("body_T_cam0", 4, 4, "0, -1, 0, 0.1, 1, 0, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1") +
                            CvMatrix("body_T_cam1", 4, 4, "1, 0, 0, 0.5, 0, 1, 0, 0.2, 0, 0, 1, 0.3, 0, 0, 0, 1");
  WriteFileAtomic(folder / "all.yaml", settings + poses);
  const geometry::Rig rig = ReadCalibration(DetectFormat(folder / "all.yaml"), {folder / "all.yaml"}).rig;
  ASSERT_EQ(rig.cameras.size(), 2u);
  ExpectCentre(rig, 0, 0.1, 0.2, 0.3);
  ExpectCentre(rig, 1, 0.5, 0.2, 0.3);
  // x of the camera lies along y of the body.
  EXPECT_NEAR((Inverse(rig.cameras[0].cam_from_world).rotation * Eigen::Vector3d::UnitX()).y(), 1, 1e-12);
  WriteFileAtomic(folder / "half.yaml", settings + CvMatrix("body_T_cam0", 4, 4, rotated));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadCalibration(kCv, {folder / "half.yaml"}); }), HasSubstr("1 of 2 cameras"));
  WriteFileAtomic(folder / "out.yaml", "%YAML:1.0\ncam0_calib: \"../left.yaml\"\n");
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadCalibration(kCv, {folder / "out.yaml"}); }), HasSubstr("no file beside"));

  const geometry::Rig mono =
      ReadProgramFile(kVinsHead + kVinsPinhole + CvMatrix("extrinsicRotation", 3, 3, "0, -1, 0, 1, 0, 0, 0, 0, 1") +
                          CvMatrix("extrinsicTranslation", 3, 1, "0.1, 0.2, 0.3"),
                      kCv)
          .rig;
  ExpectCentre(mono, 0, 0.1, 0.2, 0.3);
}

std::string OrbLines(const std::string& prefix, double fx, bool fisheye) {
  return prefix + ".fx: " + std::to_string(fx) + "\n" + prefix + ".fy: 190\n" + prefix + ".cx: 254\n" + prefix + ".cy: 256\n" +
         prefix + ".k1: 0.01\n" + prefix + ".k2: -0.02\n" +
         (fisheye ? prefix + ".k3: 0.003\n" + prefix + ".k4: 0\n" : prefix + ".p1: 0\n" + prefix + ".p2: 0\n");
}

TEST(OrbSlam, LensesAndTheSecondCamera) {
  const std::string size = "Camera.width: 512\nCamera.height: 512\nCamera.fps: 20\nCamera.RGB: 1\n";
  const double r = kPoint.head<2>().norm(), t = std::atan2(r, kPoint.z());
  const double radius = t + 0.01 * std::pow(t, 3) - 0.02 * std::pow(t, 5) + 0.003 * std::pow(t, 7);
  const std::string stereo =
      "%YAML:1.0\n\nCamera.type: \"KannalaBrandt8\"\n" + OrbLines("Camera1", 191, true) + OrbLines("Camera2", 192, true) + size;
  // Points of camera 2 in camera 1: it stands 0.1 m to its right, turned about z.
  const geometry::Rig rig =
      ReadProgramFile(stereo + CvMatrix("Stereo.T_c1_c2", 4, 4, "0, -1, 0, 0.1, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1"), kCv).rig;
  ASSERT_EQ(rig.cameras.size(), 2u);
  ExpectPixel(rig, 254 + 191 * radius * kPoint.x() / r, 256 + 190 * radius * kPoint.y() / r);
  ExpectPixel(rig, 254 + 192 * radius * kPoint.x() / r, 256 + 190 * radius * kPoint.y() / r, 1);
  ExpectCentre(rig, 1, 0.1, 0, 0);
  EXPECT_NEAR((Inverse(rig.cameras[1].cam_from_world).rotation * Eigen::Vector3d::UnitX()).y(), 1, 1e-12);
  EXPECT_THAT(RefusedFile(stereo, kCv), HasSubstr("nothing places Camera2"));

  const geometry::Rig one =
      ReadProgramFile("%YAML:1.0\n\nCamera.type: \"PinHole\"\n" + OrbLines("Camera1", 191, false) + size, kCv).rig;
  EXPECT_EQ(one.cameras[0].camera.model, LensModel::kBrown4);
  const geometry::Rig old =
      ReadProgramFile("%YAML:1.0\n\n" + OrbLines("Camera", 191, false) + size + "Viewer.PointSize:2\n", kCv).rig;
  EXPECT_LT((PixelOf(old) - PixelOf(one)).norm(), 1e-12);
  const geometry::Rig rectified =
      ReadProgramFile(
          "%YAML:1.0\n\nCamera.type: \"Rectified\"\n" + OrbLines("Camera1", 191, false) + size + "Stereo.b: 0.075\n", kCv)
          .rig;
  EXPECT_EQ(rectified.cameras[0].camera.model, LensModel::kPinhole);
  ExpectCentre(rectified, 1, 0.075, 0, 0);
  EXPECT_THAT(RefusedFile("%YAML:1.0\n\nCamera.type: \"Fov\"\n" + OrbLines("Camera1", 191, false) + size, kCv),
              HasSubstr("'Fov'"));
  EXPECT_THAT(
      RefusedFile(
          "%YAML:1.0\n\n" + OrbLines("Camera", 191, false) + size + CvMatrix("LEFT.K", 3, 3, "1, 0, 0, 0, 1, 0, 0, 0, 1"), kCv),
      HasSubstr("raw images"));
}

std::string Basalt(const std::string& type, const std::string& terms) {
  return "{\"value0\": {\"T_imu_cam\": [{\"px\": 0.1, \"py\": 0.2, \"pz\": 0.3, \"qx\": 0, \"qy\": 0, \"qz\": "
         "0.70710678118654752, "
         "\"qw\": 0.70710678118654752}], \"intrinsics\": [{\"camera_type\": \"" +
         type + "\", \"intrinsics\": {\"fx\": 350, \"fy\": 349, \"cx\": 365, \"cy\": 249, " + terms +
         "}}], \"resolution\": [[752, 480]], \"cam_time_offset_ns\": 0}}";
}

TEST(Basalt, LensesAndPoses) {
  const auto read = [](const std::string& type, const std::string& terms) {
    return ReadProgramFile(Basalt(type, terms), kKalibr, {}, "calibration.json").rig;
  };
  const double x = kPoint.x(), y = kPoint.y(), z = kPoint.z(), d = kPoint.norm();
  const geometry::Rig sphere = read("ds", "\"xi\": -0.2, \"alpha\": 0.56");
  const double shifted = -0.2 * d + z, d2 = std::sqrt(x * x + y * y + shifted * shifted), w = 0.56 * d2 + 0.44 * shifted;
  ExpectPixel(sphere, 365 + 350 * x / w, 249 + 349 * y / w);
  ExpectCentre(sphere, 0, 0.1, 0.2, 0.3);
  EXPECT_NEAR((Inverse(sphere.cameras[0].cam_from_world).rotation * Eigen::Vector3d::UnitX()).y(), 1, 1e-12);
  ExpectPixel(read("ucm", "\"alpha\": 0.6"), 365 + 350 * x / (0.6 * d + 0.4 * z), 249 + 349 * y / (0.6 * d + 0.4 * z));
  const double e = 0.6 * std::sqrt(1.1 * (x * x + y * y) + z * z) + 0.4 * z;
  ExpectPixel(read("eucm", "\"alpha\": 0.6, \"beta\": 1.1"), 365 + 350 * x / e, 249 + 349 * y / e);
  EXPECT_THAT(RefusedFile(Basalt("fov", "\"w\": 0.9"), kKalibr), HasSubstr("'fov' is no lens model here"));
}

/// camera_pose_matrix of MC-Calib is that of the camera: world from camera.
TEST(McCalib, PosesAndGroups) {
  const auto camera = [](const std::string& number, const std::string& x, const std::string& group) {
    const std::string inner = "      ";
    return "camera_" + number + ":\n   camera_matrix: !!opencv-matrix\n" + inner + "rows: 3\n" + inner + "cols: 3\n" + inner +
           "dt: d\n" + inner + "data: [500, 0, 320, 0, 501, 240, 0, 0, 1]\n   distortion_vector: !!opencv-matrix\n" + inner +
           "rows: 1\n" + inner + "cols: 4\n" + inner + "dt: d\n" + inner +
           "data: [0.01, -0.02, 0.003, 0]\n   distortion_type: 1\n" + "   camera_group: " + group +
           "\n   img_width: 640\n   img_height: 480\n   camera_pose_matrix: !!opencv-matrix\n" + inner + "rows: 4\n" + inner +
           "cols: 4\n" + inner + "dt: d\n" + inner + "data: [0, -1, 0, " + x + ", 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\n";
  };
  const std::string head = "%YAML:1.0\n---\nnb_camera: 2\n";
  const geometry::Rig rig = ReadProgramFile(head + camera("0", "0", "0") + camera("1", "0.3", "0"), kCv).rig;
  ASSERT_EQ(rig.cameras.size(), 2u);
  EXPECT_EQ(rig.cameras[1].camera.name, "camera_1");
  EXPECT_EQ(rig.cameras[1].camera.model, LensModel::kKannalaBrandt4);
  ExpectCentre(rig, 1, 0.3, 0, 0);
  EXPECT_THAT(RefusedFile(head + camera("0", "0", "0") + camera("1", "0.3", "1"), kCv), HasSubstr("groups"));
}

TEST(Multical, CamerasAndTheirPoses) {
  const std::string lens =
      "{\"model\": \"standard\", \"image_size\": [1920, 1080], \"K\": [[1500, 0, 960], [0, 1500, 540], [0, 0, 1]], "
      "\"dist\": [[0.01, 0, 0, 0, 0]]}";
  const auto pose = [](const char* x) {
    return "{\"R\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], \"T\": [" + std::string(x) + ", 0, 0]}";
  };
  const ImportedRig read =
      ReadProgramFile("{\"cameras\": {\"a\": " + lens + ", \"b\": " + lens + "}, \"camera_poses\": {\"a\": " + pose("0") +
                          ", \"b_to_a\": " + pose("-0.5") + "}, \"image_sets\": {\"rgb\": []}}",
                      kCv, {}, "calibration.json");
  ASSERT_EQ(read.rig.cameras.size(), 2u);
  EXPECT_EQ(read.rig.cameras[1].camera.name, "b");
  ExpectCentre(read.rig, 1, 0.5, 0, 0);
}

/// MATLAB counts pixels from 1, states rows before columns, and writes older matrices for row vectors.
TEST(Matlab, StereoParameters) {
  const std::string lens =
      "{\"ImageSize\": [480, 640], \"IntrinsicMatrix\": [[500, 0, 0], [0, 501, 0], [321, 241, 1]], \"RadialDistortion\": "
      "[-0.2, 0.05, 0.01], \"TangentialDistortion\": [0.001, 0.002]}";
  const std::string text =
      "{\"CameraParameters1\": " + lens + ", \"CameraParameters2\": " + lens +
      ", \"RotationOfCamera2\": [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], \"TranslationOfCamera2\": [0, -120, 0]}";
  ReadOptions millimetres;
  millimetres.metres_per_unit = 1e-3;
  const geometry::Rig rig = ReadProgramFile(text, kCv, millimetres, "stereo.json").rig;
  ASSERT_EQ(rig.cameras.size(), 2u);
  const geometry::Camera& camera = rig.cameras[0].camera;
  EXPECT_EQ(camera.width_px, 640);
  EXPECT_EQ(camera.cx(), 320);
  EXPECT_EQ(camera.cy(), 240);
  EXPECT_EQ(camera.params.tail(5), (Eigen::VectorXd(5) << -0.2, 0.05, 0.001, 0.002, 0.01).finished());
  // x2 = x1 R + t of MATLAB's manual: (1, 0, 0) m becomes (0, 1, 0) + t.
  EXPECT_LT((rig.cameras[1].cam_from_world * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, 0.88, 0)).norm(), 1e-12);
  std::string stated = text;
  stated.replace(stated.find("\"ImageSize\""), 0, "\"WorldUnits\": \"millimeters\", ");
  EXPECT_THAT(RefusedFile(stated, kCv), HasSubstr("'unit' millimeters"));
  EXPECT_EQ(ReadProgramFile(stated, kCv, millimetres, "stereo.json").rig.cameras.size(), 2u);
  EXPECT_THAT(RefusedFile("{\"camera_matrix\": [[500, 0, 0], [0, 501, 0], [321, 241, 1]], \"image_size\": [640, 480]}", kCv),
              HasSubstr("transposed"));
}

/// Stereo files by the names of OpenCV's arguments, and rvec with tvec.
TEST(OpenCvNames, OfStereoAndPoses) {
  const std::string head = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n";
  const std::string k = "500, 0, 320, 0, 501, 240, 0, 0, 1", d = "0.1, 0.02, 0, 0, 0";
  const std::string pose = CvMatrix("R", 3, 3, "1, 0, 0, 0, 1, 0, 0, 0, 1") + CvMatrix("T", 3, 1, "-0.12, 0, 0");
  for (const auto& [m, c] :
       {std::pair("M", "D"), std::pair("K", "D"), std::pair("cameraMatrix", "distCoeffs"), std::pair("mtx", "dist")}) {
    const std::string one(1, '1'), two(1, '2');
    const geometry::Rig rig = ReadProgramFile(head + CvMatrix(m + one, 3, 3, k) + CvMatrix(c + one, 1, 5, d) +
                                                  CvMatrix(m + two, 3, 3, k) + CvMatrix(c + two, 1, 5, d) + pose,
                                              kCv)
                                  .rig;
    ASSERT_EQ(rig.cameras.size(), 2u) << m;
    EXPECT_EQ(rig.cameras[1].camera.params[4], 0.1) << m;
    ExpectCentre(rig, 1, 0.12, 0, 0);
  }
  const geometry::Rig placed = ReadProgramFile(head + CvMatrix("camera_matrix", 3, 3, k) + CvMatrix("rvec", 3, 1, "0, 0, 0") +
                                                   CvMatrix("tvec", 3, 1, "0, 0, 2"),
                                               kCv)
                                   .rig;
  ExpectCentre(placed, 0, 0, 0, -2);
}

/// A camera for files of matrices: x = K (R X + t), written out, is the oracle.
struct MatrixCamera {
  Eigen::Matrix3d k, r;
  Eigen::Vector3d t;
  MatrixCamera(double f, double turn)
      : k((Eigen::Matrix3d() << f, 0, 320.5, 0, f + 1, 239.25, 0, 0, 1).finished()),
        r((Eigen::AngleAxisd(turn, Eigen::Vector3d(0.3, -0.5, 0.8).normalized())).toRotationMatrix()),
        t(0.1 + turn, -0.2, 0.4) {}
  Eigen::Vector3d centre() const { return -r.transpose() * t; }
  Eigen::Vector3d InCam(const Eigen::Vector3d& x) const { return r * x + t; }
};

std::string TextOf(const Eigen::MatrixXd& m, const char* between = "\n") {
  std::string text;
  for (int y = 0; y < m.rows(); ++y) {
    for (int x = 0; x < m.cols(); ++x) text += mvstudio::Format("%.17g", m(y, x)) + (x + 1 < m.cols() ? " " : "");
    text += y + 1 < m.rows() ? between : "\n";
  }
  return text;
}

/// Points in front of the camera land where the formula puts them.
void ExpectCamera(const geometry::Rig& rig, size_t i, const MatrixCamera& camera,
                  const std::function<Eigen::Vector2d(const Eigen::Vector2d&)>& bend = nullptr) {
  ASSERT_LT(i, rig.cameras.size());
  for (const Eigen::Vector3d& in_cam : {Eigen::Vector3d(0.4, -0.3, 2), Eigen::Vector3d(-0.2, 0.5, 3)}) {
    const Eigen::Vector3d in_world = camera.r.transpose() * (in_cam - camera.t);
    const Eigen::Vector2d plain = in_cam.hnormalized(), bent = bend ? bend(plain) : plain;
    const Eigen::Vector2d px = (camera.k * bent.homogeneous()).hnormalized();
    const geometry::RigCamera& read = rig.cameras[i];
    EXPECT_LT((geometry::Project(read.camera, read.cam_from_world * in_world).px - px).norm(), 1e-9) << px.transpose();
  }
}

ReadOptions InMetres() {
  ReadOptions options;
  options.metres_per_unit = 1, options.width_px = 640, options.height_px = 480;
  return options;
}

TEST(MatrixText, KindsThatHoldOneCameraAFile) {
  const MatrixCamera c(800, 0.7);
  Eigen::Matrix<double, 3, 4> rt;
  rt << c.r, c.t;
  const std::string k = TextOf(c.k), r = TextOf(c.r), t = TextOf(c.t.transpose());
  const auto read = [&](const std::string& text, const char* name = "cam_P.txt") {
    return ReadProgramFile(text, kCv, InMetres(), name).rig;
  };
  ExpectCamera(read(k + "\n" + r + "\n" + t + "\n0\n", "a.krtd"), 0, c);
  const auto brown = [](const Eigen::Vector2d& x) {
    const double r2 = x.squaredNorm(), radial = 1 - 0.1 * r2 + 0.02 * r2 * r2;
    return Eigen::Vector2d(x.x() * radial + 2 * 0.001 * x.x() * x.y() + 0.002 * (r2 + 2 * x.x() * x.x()),
                           x.y() * radial + 0.001 * (r2 + 2 * x.y() * x.y()) + 2 * 0.002 * x.x() * x.y());
  };
  ExpectCamera(read(k + r + t + "-0.1 0.02 0.001 0.002\n", "a.krtd"), 0, c, brown);
  ExpectCamera(read("extrinsic\n" + TextOf(rt) + "0 0 0 1\n\nintrinsic\n" + k + "\n425.0 2.5\n", "00_cam.txt"), 0, c);
  ExpectCamera(read(k + "0 0 0\n" + TextOf(c.r.transpose()) + TextOf(c.centre().transpose()) + "640 480\n", "0.camera"), 0, c);
  for (const double scale : {1.0, -3.5}) {  // P means the same times any number
    ExpectCamera(read("CONTOUR\n" + TextOf(scale * c.k * rt)), 0, c);
    ExpectCamera(read(TextOf(scale * c.k * rt)), 0, c);
  }
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadProgramFile(k + r + t + "0\n", kCv, {}, "a.krtd"); }), HasSubstr("'size'"));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadProgramFile(k + TextOf(2 * c.r) + t + "0\n", kCv, InMetres(), "a.krtd"); }),
              HasSubstr("rotation"));
  EXPECT_THAT(RefusedFile(TextOf(rt), kCv, InMetres()), HasSubstr("not a calibration")) << "a pose has no focal length";
}

/// Whether a note names what is left out.
bool IsLeftOut(const ImportedRig& imported, const char* name) {
  return std::any_of(imported.notes.begin(), imported.notes.end(), [&](const Notice& note) {
    return note.code == "CAL-IGNORED" && note.text.find(name) != std::string::npos;
  });
}

TEST(MatrixText, KindsThatHoldSeveralCameras) {
  const MatrixCamera a(800, 0.7), b(900, -0.4);
  std::string par = "2\n", krt, bundle = "# Bundle file v0.3\n3 0\n0 0 0\n" + TextOf(Eigen::Matrix3d::Zero()) + "0 0 0\n";
  const Eigen::Vector3d axes(1, -1, -1);
  for (const MatrixCamera& c : {a, b}) {
    const std::string name = c.k(0, 0) < 850 ? "a" : "b";
    par += name + ".png " + TextOf(c.k, " ") + TextOf(c.r, " ") + TextOf(c.t, " ");
    std::replace(par.begin() + static_cast<long>(par.rfind(name + ".png")), par.end(), '\n', ' ');
    par += "\n";
    Eigen::Matrix<double, 3, 4> rt;
    rt << c.r, c.t;
    krt += name + "\n" + TextOf(c.k) + "0 0 0 0 0\n" + TextOf(rt) + "\n";
    bundle += TextOf(Eigen::RowVector3d(c.k(0, 0), -0.1, 0.02)) + TextOf(axes.asDiagonal() * c.r) +
              TextOf(axes.cwiseProduct(c.t).transpose());
  }
  for (const std::string& text : {par, krt}) {
    const geometry::Rig rig = ReadProgramFile(text, kCv, InMetres(), "cams.txt").rig;
    ASSERT_EQ(rig.cameras.size(), 2u);
    EXPECT_EQ(rig.cameras[1].camera.name, "b");
    ExpectCamera(rig, 0, a), ExpectCamera(rig, 1, b);
  }
  const ImportedRig bundled = ReadProgramFile(bundle, kCv, InMetres(), "bundle.out");
  const geometry::Rig& rig = bundled.rig;
  ASSERT_EQ(rig.cameras.size(), 2u) << "one is not placed";
  EXPECT_TRUE(IsLeftOut(bundled, "camera_0"));
  EXPECT_EQ(rig.cameras[0].camera.name, "camera_1");
  const auto radial = [](const Eigen::Vector2d& x) {
    const double r2 = x.squaredNorm();
    return Eigen::Vector2d(x * (1 - 0.1 * r2 + 0.02 * r2 * r2));
  };
  MatrixCamera centred = b;  // one focal length, the principal point in the image's middle
  centred.k(1, 1) = 900, centred.k(0, 2) = 319.5, centred.k(1, 2) = 239.5;
  ExpectCamera(rig, 1, centred, radial);
}

/// Metashape's manual: u = w / 2 + cx + x f + x b1, v = h / 2 + cy + y f; the middle of the first pixel is 0.5.
TEST(Metashape, CamerasOfAChunk) {
  const MatrixCamera c(800, 0.7);
  const double f = c.k(1, 1);
  // world = 2 R x + t of the chunk
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()).toRotationMatrix();
  const Eigen::Vector3d shift(1, 2, 3);
  Eigen::Matrix4d chunk_from_cam = Eigen::Matrix4d::Identity();
  chunk_from_cam.topLeftCorner<3, 3>() = turn.transpose() * c.r.transpose();
  chunk_from_cam.topRightCorner<3, 1>() = turn.transpose() * (c.centre() - shift) / 2;
  const auto document = [&](const std::string& type) {
    return "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<document version=\"2.0.0\"><chunk label=\"1\"><sensors>"
           "<sensor id=\"0\" type=\"frame\"><resolution width=\"640\" height=\"480\"/><calibration type=\"" +
           type + "\" class=\"adjusted\"><resolution width=\"640\" height=\"480\"/><f>" +
           TextOf(Eigen::Matrix<double, 1, 1>(f)) +
           "</f><cx>1</cx><cy>-0.25</cy><b1>-1</b1><k1>-0.1</k1><k2>0.02</k2><p1>0.002</p1><p2>0.001</p2></calibration></"
           "sensor>"
           "</sensors><cameras><camera id=\"0\" sensor_id=\"0\" label=\"a.jpg\"><transform>" +
           TextOf(chunk_from_cam, " ") +
           "</transform></camera><camera id=\"1\" sensor_id=\"0\" label=\"lost.jpg\"/></cameras><transform><rotation>" +
           TextOf(turn, " ") + "</rotation><translation>1 2 3</translation><scale>2</scale></transform></chunk></document>";
  };
  const ImportedRig imported = ReadProgramFile(document("frame"), kCv, InMetres(), "cameras.xml");
  ASSERT_EQ(imported.rig.cameras.size(), 1u);
  EXPECT_EQ(imported.rig.cameras[0].camera.name, "a");
  EXPECT_TRUE(IsLeftOut(imported, "lost.jpg"));
  MatrixCamera expected = c;
  expected.k(0, 2) = 320 + 1 - 0.5, expected.k(1, 2) = 240 - 0.25 - 0.5;
  ExpectCamera(imported.rig, 0, expected, [](const Eigen::Vector2d& x) {
    const double r2 = x.squaredNorm(), radial = 1 - 0.1 * r2 + 0.02 * r2 * r2, p1 = 0.002, p2 = 0.001;
    return Eigen::Vector2d(x.x() * radial + p1 * (r2 + 2 * x.x() * x.x()) + 2 * p2 * x.x() * x.y(),
                           x.y() * radial + p2 * (r2 + 2 * x.y() * x.y()) + 2 * p1 * x.x() * x.y());
  });
  EXPECT_THAT(RefusedFile(document("fisheye"), kCv, InMetres()), HasSubstr("type fisheye"));

  // Newer exports: the transform is that of a component.
  std::string text = document("frame");
  const auto put = [&](const std::string& old, const std::string& now) { text.replace(text.find(old), old.size(), now); };
  const size_t begin = text.find("<transform><rotation>"), end = text.find("</chunk>");
  const std::string transform = text.substr(begin, end - begin);
  put(transform, "<components><component id=\"3\">" + transform + "</component><component id=\"4\"/></components>");
  put("<camera id=\"0\"", "<camera id=\"0\" component_id=\"3\"");
  put("a.jpg", "rig.A");
  const geometry::Rig of_component = ReadProgramFile(text, kCv, InMetres(), "cameras.xml").rig;
  EXPECT_EQ(of_component.cameras[0].camera.name, "rig.A");
  ExpectCentre(of_component, 0, c.centre().x(), c.centre().y(), c.centre().z());
  const std::string pose = "<transform>" + TextOf(Eigen::Matrix4d::Identity(), " ") + "</transform></camera>";
  put("id=\"1\" sensor_id=\"0\" label=\"lost.jpg\"/>", "id=\"1\" component_id=\"3\" sensor_id=\"0\" label=\"rig.B\">" + pose);
  const geometry::Rig both = ReadProgramFile(text, kCv, InMetres(), "cameras.xml").rig;
  ASSERT_EQ(both.cameras.size(), 2u);
  ExpectCentre(both, 1, 1, 2, 3);
  put("id=\"1\" component_id=\"3\"", "id=\"1\" component_id=\"4\"");
  EXPECT_THAT(RefusedFile(text, kCv, InMetres()), HasSubstr("no world in common"));

  text = document("frame");  // PhotoScan's
  const size_t f_begin = text.find("<f>"), f_end = text.find("</f>");
  text.replace(f_begin, f_end + 4 - f_begin, "<fx>800</fx><fy>801</fy><skew>5</skew>");
  EXPECT_THAT(RefusedFile(text, kCv, InMetres()), HasSubstr("skew"));
}

TEST(OpenMvg, ViewsWithAPose) {
  MatrixCamera c(800, 0.7);
  c.k(1, 1) = 800;
  const auto list = [](const Eigen::MatrixXd& m) {
    std::string text = TextOf(m, "], [");
    std::replace(text.begin(), text.end(), '\n', ' ');
    for (size_t at = text.find(' '); at != std::string::npos; at = text.find(' ', at + 2)) {
      if (at > 0 && text[at - 1] != ',' && at + 1 < text.size()) text.insert(at, ",");
    }
    return "[" + text + "]";
  };
  const std::string view =
      "\"ptr_wrapper\": {\"data\": {\"local_path\": \"\", \"filename\": \"a.jpg\", \"id_intrinsic\": 7, \"id_pose\": 3}}";
  std::string lost = view;
  lost.replace(lost.find("\"id_pose\": 3"), 12, "\"id_pose\": 4"), lost.replace(lost.find("a.jpg"), 5, "lost.jpg");
  const std::string text =
      "{\"sfm_data_version\": \"0.3\", \"views\": [{\"key\": 0, \"value\": {" + view + "}}, {\"key\": 1, \"value\": {" + lost +
      "}}], \"intrinsics\": [{\"key\": 7, \"value\": {\"polymorphic_id\": 2147483649, \"polymorphic_name\": "
      "\"pinhole_brown_t2\", \"ptr_wrapper\": {\"data\": {\"width\": 640, \"height\": 480, \"focal_length\": 800, "
      "\"principal_point\": [320.5, 239.25], \"disto_t2\": [-0.1, 0.02, 0.003, 0.001, 0.002]}}}}], \"extrinsics\": [{\"key\": "
      "3, "
      "\"value\": {\"rotation\": [" +
      list(c.r) + "], \"center\": " + list(c.centre().transpose()) + "}}]}";
  const ImportedRig imported = ReadProgramFile(text, kCv, InMetres(), "sfm_data.json");
  const geometry::Rig& rig = imported.rig;
  ASSERT_EQ(rig.cameras.size(), 1u);
  EXPECT_TRUE(IsLeftOut(imported, "lost.jpg"));
  ExpectCamera(rig, 0, c, [](const Eigen::Vector2d& x) {
    const double r2 = x.squaredNorm(), radial = 1 - 0.1 * r2 + 0.02 * r2 * r2 + 0.003 * r2 * r2 * r2, t1 = 0.001, t2 = 0.002;
    return Eigen::Vector2d(x.x() * radial + t2 * (r2 + 2 * x.x() * x.x()) + 2 * t1 * x.x() * x.y(),
                           x.y() * radial + t1 * (r2 + 2 * x.y() * x.y()) + 2 * t2 * x.x() * x.y());
  });
}

}  // namespace
}  // namespace mvstudio::calib
