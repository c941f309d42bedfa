#include "calib/formats/formats.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "geometry/rig/alignment.h"
#include "geometry/rig/lenses_only.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test_data.h"

namespace mvstudio::calib {
namespace {

using geometry::LensModel;
using geometry::Rig;
using mvstudio::testing::DataRoot;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;

constexpr char kToml[] = R"(# two cameras
[cam_b]
name = "cam_b"
size = [ 1088.0, 1920.0]
matrix = [ [ 1681.25, 0.0, 532.5], [ 0.0, 1681.0, 948.25], [ 0.0, 0.0, 1.0]]
distortions = [ -0.05, 0.02, 0.001, -0.002]
rotation = [ 0.0, 0.0, 1.5707963267948966]
translation = [ 1.0, 2.0, 3.0]
fisheye = false

[cam_a]
size = [ 640, 480 ]
matrix = [ [ 500, 0, 320], [ 0, 501, 240], [ 0, 0, 1]]
distortions = [ 0.01, 0.02, 0.03, 0.04]
rotation = [ [0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0] ]
translation = [ 0.0, 0.0, 0.5]
fisheye = true

[metadata]
error = 0.0
)";

constexpr char kQca[] = R"(<?xml version='1.0'?>
<!-- made by hand -->
<calibration created="x &amp; y">
  <cameras>
    <camera serial="7" viewrotation="0">
      <fov_video bottom="1079" left="10" right="1929" top="20"/>
      <transform r11="1" r12="0" r13="0" r21="0" r22="0" r23="1" r31="0" r32="-1" r33="0" x="1000" y="-2000" z="1500"/>
      <intrinsic centerPointU="62080" centerPointV="35840" focalLengthU="64000" focalLengthV="64064" radialDistortion1="-0.1"
        radialDistortion2="0.05" radialDistortion3="0" skew="0" tangentalDistortion1="0.001" tangentalDistortion2="0.002"/>
    </camera>
  </cameras>
</calibration>
)";

constexpr char kStereo[] = R"(%YAML:1.0
---
# comment
image_width: 640
image_height: 480
M1: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 5.3e+02, 0., 3.3e+002, 0.,
       5.4e+02, 2.4e+02, 0., 0., 1. ]
D1: !!opencv-matrix
   rows: 1
   cols: 14
   dt: d
   data: [ .1, -.2, 0.001, 0.002, 0.3, 0., 0., 0., 0., 0., 0., 0., 0., 0. ]
M2: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 530., 0., 330., 0., 530., 240., 0., 0., 1. ]
D2: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 0., 0., 0., 0., 0. ]
)";

constexpr char kExtrinsics[] = R"(%YAML:1.0
R: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 0., -1., 0., 1., 0., 0., 0., 0., 1. ]
T: !!opencv-matrix
   rows: 3
   cols: 1
   dt: d
   data: [ -83., 1., 2. ]
)";

/// Every format's reader on a text, through a file.
ImportedRig Read(CalibrationFormat format, const std::string& text) {
  static const TempDir folder;  // one for all: thousands of damaged files go through it
  const std::string path = folder / "file.txt";
  std::filesystem::remove(path);  // a file that is truncated instead is flushed to the disk on closing by some file systems
  std::ofstream(path, std::ios::binary) << text;  // not WriteFileAtomic: thousands of files need no flush to the disk
  if (format == CalibrationFormat::kToml) return ReadToml(path);
  if (format == CalibrationFormat::kQca) return ReadQca(path);
  return ReadOpenCvYaml({path}, {});
}

std::string Complaint(CalibrationFormat format, const std::string& text) {
  try {
    Read(format, text);
  } catch (const FormatError& error) {
    return error.where() + ": " + error.what();
  }
  return "accepted";
}

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

TEST(QualisysToml, ReadsBothKindsOfRotationInFileOrder) {
  const Rig rig = Read(CalibrationFormat::kToml, kToml).rig;
  ASSERT_EQ(rig.cameras.size(), 2u);
  const auto &b = rig.cameras[0], &a = rig.cameras[1];
  EXPECT_EQ(b.camera.name, "cam_b");
  EXPECT_EQ(a.camera.name, "cam_a");
  EXPECT_EQ(b.camera.model, LensModel::kBrown4);
  EXPECT_EQ(a.camera.model, LensModel::kKannalaBrandt4);
  EXPECT_EQ(b.camera.width_px, 1088);
  EXPECT_EQ(b.camera.params, (Eigen::VectorXd(8) << 1681.25, 1681, 532.5, 948.25, -0.05, 0.02, 0.001, -0.002).finished());
  // Both turn a quarter about z: (1, 0, 0) in the world goes to (0, 1, 0).
  EXPECT_LT((b.cam_from_world * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(1, 3, 3)).norm(), 1e-15);
  EXPECT_LT((a.cam_from_world * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0, 1, 0.5)).norm(), 1e-15);
}

TEST(QualisysToml, ErrorsNameThePlace) {
  const auto expect = [](const std::string& from, const std::string& to, const std::string& place) {
    const std::string complaint = Complaint(CalibrationFormat::kToml, Replaced(kToml, from, to));
    EXPECT_EQ(complaint.rfind(place + ": ", 0), 0u) << complaint;
  };
  expect("1681.25", "\"x\"", "cam_b.matrix[0][0]");
  expect("1681.25", "nan", "cam_b.matrix[0][0]");
  expect("1681.25", "-1.0", "cam_b");
  expect("[ 1681.25, 0.0,", "[ 1681.25, 0.5,", "cam_b");
  expect("translation = [ 1.0, 2.0, 3.0]", "", "cam_b.translation");
  expect("translation = [ 1.0, 2.0, 3.0]", "translation = [1.0, 2.0]", "cam_b.translation");
  expect("[1.0, 0.0, 0.0], [0.0, 0.0, 1.0] ]", "[1.0, 0.0, 0.0], [0.0, 0.0, -1.0] ]", "cam_a.rotation");
  expect("-0.05, 0.02, 0.001, -0.002", "1, 2, 3", "cam_b");
  expect("1088.0", "1088.5", "cam_b");
  expect("[cam_a]", "[cam_a", "line 11, column 7");
}

TEST(Qca, ConventionsByHand) {
  const ImportedRig imported = Read(CalibrationFormat::kQca, kQca);
  ASSERT_EQ(imported.rig.cameras.size(), 1u);
  const auto& camera = imported.rig.cameras[0];
  EXPECT_EQ(camera.camera.name, "7");
  EXPECT_EQ(camera.camera.width_px, 1920);
  EXPECT_EQ(camera.camera.height_px, 1060);
  const Eigen::VectorXd expected = (Eigen::VectorXd(8) << 1000, 1001, 960, 540, -0.1, 0.05, 0.001, 0.002).finished();
  EXPECT_LT((camera.camera.params - expected).norm(), 1e-13);
  EXPECT_LT((camera.CenterInWorld() - Eigen::Vector3d(1, -2, 1.5)).norm(), 1e-15);
  // Turned so that the camera stands upright and looks along +y of the world, as a file camera that looks along its -z does.
  EXPECT_LT((camera.cam_from_world.rotation * Eigen::Vector3d(0, 1, 0) - Eigen::Vector3d(0, 0, 1)).norm(), 1e-15);
  EXPECT_LT((camera.cam_from_world.rotation * Eigen::Vector3d(0, 0, 1) - Eigen::Vector3d(0, -1, 0)).norm(), 1e-15);
}

TEST(Qca, DistortionDivisorIsAnOption) {
  const TempDir folder;
  WriteFileAtomic(folder / "a.qca.txt", Replaced(kQca, "-0.1", "-6.4"));
  const ImportedRig as_they_stand = ReadQca(folder / "a.qca.txt");
  EXPECT_NEAR(as_they_stand.rig.cameras[0].camera.params[4], -6.4, 1e-15);
  EXPECT_THAT(as_they_stand.notes.back().text, HasSubstr("a k1 of 6.4 is no lens's"));
  ReadOptions options;
  options.qca_distortion_divisor = 64;
  EXPECT_NEAR(ReadQca(folder / "a.qca.txt", options).rig.cameras[0].camera.params[4], -0.1, 1e-15);
}

TEST(Qca, TheDivisorHoldsInBothDirections) {
  const TempDir folder;
  ReadOptions read;
  WriteOptions write;
  read.qca_distortion_divisor = write.qca_distortion_divisor = 64;
  const Rig rig = Read(CalibrationFormat::kQca, kQca).rig;  // k1 = -0.1
  const ExportReport plain = WriteCalibration(rig, CalibrationFormat::kQca, folder / "plain.qca.txt");
  EXPECT_TRUE(plain.notes.empty());
  EXPECT_NEAR(ReadQca(folder / "plain.qca.txt").rig.cameras[0].camera.params[4], -0.1, 1e-15);
  EXPECT_TRUE(ReadQca(folder / "plain.qca.txt").notes.empty());
  const ExportReport times_64 = WriteCalibration(rig, CalibrationFormat::kQca, folder / "times.qca.txt", write);
  ASSERT_EQ(times_64.notes.size(), 1u);
  EXPECT_EQ(times_64.notes[0].code, "CAL-QCADISTORTION");
  EXPECT_NEAR(ReadQca(folder / "times.qca.txt", read).rig.cameras[0].camera.params[4], -0.1, 1e-15);
  // A file of plain coefficients that is divided all the same.
  Rig weak = rig;
  weak.cameras[0].camera.params[4] = -0.04;
  WriteCalibration(weak, CalibrationFormat::kQca, folder / "weak.qca.txt");
  EXPECT_THAT(ReadQca(folder / "weak.qca.txt", read).notes.back().text, HasSubstr("and these look like it"));
}

TEST(Qca, ErrorsNameThePlace) {
  const auto expect = [](const std::string& from, const std::string& to, const std::string& place) {
    const std::string complaint = Complaint(CalibrationFormat::kQca, Replaced(kQca, from, to));
    EXPECT_EQ(complaint.rfind(place, 0), 0u) << complaint;
  };
  expect("focalLengthU=\"64000\"", "focalLengthU=\"x\"", "camera[0].intrinsic.focalLengthU");
  expect("focalLengthU=\"64000\"", "", "camera[0].intrinsic");
  expect("skew=\"0\"", "skew=\"100\"", "camera[0].intrinsic");
  expect("r11=\"1\"", "r11=\"-1\"", "camera[0].transform");
  expect("serial=\"7\"", "", "camera[0]");
  expect("</camera>", "", "line ");
  expect("left=\"10\"", "left=10", "line ");
  expect("<?xml version='1.0'?>", "<!DOCTYPE a [<!ENTITY b \"c\">]>", "line 1");
  expect("<cameras>", "<cameras left=\"1\" left=\"2\">", "line ");
  expect("</cameras>", "</camera>", "line 11");
}

/// Nothing that a file could define is put in for an entity.
TEST(Qca, EntitiesAreXmlsOwn) {
  EXPECT_EQ(
      Read(CalibrationFormat::kQca, Replaced(kQca, "serial=\"7\"", "serial=\"a&amp;&#98;&evil;\"")).rig.cameras[0].camera.name,
      "a&b&evil;");
}

TEST(Qca, DepthIsBounded) {
  const auto nested = [](size_t levels) {
    std::string open, close;
    for (size_t i = 0; i < levels; ++i) open += "<a>", close += "</a>";
    return Complaint(CalibrationFormat::kQca, open + close);
  };
  EXPECT_THAT(nested(64), HasSubstr("there is no <camera> in it"));
  EXPECT_THAT(nested(65), HasSubstr("nested deeper than 64 levels"));
  EXPECT_THAT(nested(300000), HasSubstr("nested deeper than 64 levels"));
}

TEST(OpenCvYaml, ReadsStereoFromTwoFiles) {
  const TempDir folder;
  WriteFileAtomic(folder / "in.yml", kStereo);
  WriteFileAtomic(folder / "ex.yml", kExtrinsics);
  ReadOptions options;
  options.metres_per_unit = 1e-3;
  const ImportedRig imported = ReadOpenCvYaml({folder / "in.yml", folder / "ex.yml"}, options);
  ASSERT_EQ(imported.rig.cameras.size(), 2u);
  const auto &left = imported.rig.cameras[0], &right = imported.rig.cameras[1];
  EXPECT_EQ(left.camera.name, "left");
  EXPECT_EQ(left.camera.model, LensModel::kRational8);
  EXPECT_EQ(left.camera.params.head<9>(), (Eigen::VectorXd(9) << 530, 540, 330, 240, .1, -.2, .001, .002, .3).finished());
  EXPECT_EQ(right.camera.model, LensModel::kPinhole);
  EXPECT_LT((right.cam_from_world * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(-0.083, 1.001, 0.002)).norm(), 1e-15);
  EXPECT_EQ(imported.notes.at(0).code, "CAL-UNIT");
}

/// Lenses whose poses no file states are lenses only; a pose in halves, or of some cameras, is damage.
TEST(LensesOnly, AreNoRigAtTheOrigin) {
  const std::string lens =
      "size = [640, 480]\nmatrix = [[500.0, 0.0, 319.5], [0.0, 500.0, 239.5], [0.0, 0.0, 1.0]]\n"
      "distortions = [0.1, 0.0, 0.0, 0.0]\n";
  const std::string pose = "rotation = [0.0, 0.0, 0.1]\ntranslation = [0.1, 0.0, 0.0]\n";
  const ImportedRig toml = Read(CalibrationFormat::kToml, "[cam_0]\n" + lens + "[cam_1]\n" + lens);
  EXPECT_EQ(toml.rig.gauge, geometry::kLensesOnly);
  EXPECT_EQ(toml.notes.at(0).code, "CAL-NOPOSE");
  EXPECT_NE(Complaint(CalibrationFormat::kToml, "[cam_0]\n" + lens + pose + "[cam_1]\n" + lens).find("all or none"),
            std::string::npos);
  EXPECT_NE(Complaint(CalibrationFormat::kToml, "[cam_0]\n" + lens + "rotation = [0.0, 0.0, 0.1]\n").find("translation"),
            std::string::npos);
  EXPECT_EQ(Read(CalibrationFormat::kOpenCvYaml, kStereo).rig.gauge, geometry::kLensesOnly);
  Rig rig = toml.rig;
  rig.gauge = "as imported";
  EXPECT_TRUE(geometry::HasLensesOnly(rig)) << "a program that has no poses wrote them at the origin";
  rig.cameras[1].cam_from_world.translation.x() = 0.1;
  EXPECT_FALSE(geometry::HasLensesOnly(rig));
}

TEST(OpenCvYaml, SaysWhatItMisses) {
  EXPECT_EQ(Read(CalibrationFormat::kOpenCvYaml, kStereo).notes.at(0).code, "CAL-NOPOSE");
  EXPECT_THROW(Read(CalibrationFormat::kOpenCvYaml, Replaced(kStereo, "image_width: 640\n", "")), UsageError);
  EXPECT_NE(Complaint(CalibrationFormat::kOpenCvYaml, kExtrinsics).find("camera_matrix"), std::string::npos);
  EXPECT_THROW(ReadOpenCvYaml({}, {}), UsageError);
}

TEST(OpenCvYaml, ErrorsNameThePlace) {
  const auto expect = [](const std::string& from, const std::string& to, const std::string& place) {
    const std::string complaint = Complaint(CalibrationFormat::kOpenCvYaml, Replaced(kStereo, from, to));
    EXPECT_EQ(complaint.rfind(place + ": ", 0), 0u) << complaint;
  };
  expect("5.3e+02", "5.3e+02x", "M1[0]");
  expect("5.3e+02", ".Nan", "M1[0]");
  expect("rows: 3", "rows: 4", "M1");
  expect("rows: 3", "rows: 99999999999", "M1");
  expect("rows: 3", "rows: -3", "M1");
  expect("M2:", "M1:", "line 17");
  expect("%YAML:1.0", "YAML", "line 1");
  expect("image_width: 640", "image_width", "line 5");
  expect("0., 0., 1. ]\nD1", "0., 0., 1. \nD1", "line 12");
  expect("data: [ 5.3e+02, 0., 3.3e+002, 0.,\n       5.4e+02, 2.4e+02, 0., 0., 1. ]", "", "M1");
}

/// OpenCV appends to a file as a document of its own.
TEST(OpenCvYaml, SeveralDocumentsAreOne) {
  EXPECT_EQ(Read(CalibrationFormat::kOpenCvYaml, Replaced(kStereo, "M2:", "...\n---\nM2:")).rig.cameras.size(), 2u);
  EXPECT_EQ(Complaint(CalibrationFormat::kOpenCvYaml, Replaced(kStereo, "M2:", "...\n---\nM1:")).rfind("line 19: ", 0), 0u);
}

/// A key that is cut short must not read as one without a value: the lens would be another.
TEST(OpenCvYaml, ACutKeyIsRefused) {
  const std::string text(kStereo);
  for (size_t length = text.find("D2:") + 1; length < text.find("D2:") + 3; ++length) {
    EXPECT_NE(Complaint(CalibrationFormat::kOpenCvYaml, text.substr(0, length)), "accepted") << length;
  }
}

/// Truncation at every byte and random bytes: an exception of the contract or a rig, never anything else.
TEST(Formats, DamagedFilesAreRefusedOrRead) {
  const std::pair<CalibrationFormat, std::string> samples[] = {
      {CalibrationFormat::kToml, kToml}, {CalibrationFormat::kQca, kQca}, {CalibrationFormat::kOpenCvYaml, kStereo}};
  Rng rng(1);
  for (const auto& [format, text] : samples) {
    int refused = 0;
    const auto attempt = [&](const std::string& damaged) {
      try {
        for (const auto& camera : Read(format, damaged).rig.cameras) geometry::Validate(camera.camera);
      } catch (const FormatError& error) {
        ++refused;
        ASSERT_EQ(std::string(error.what()).find('\n'), std::string::npos) << error.what();
      } catch (const UsageError&) {
        ++refused;
      }
    };
    for (size_t length = 0; length < text.size(); length += 3) attempt(text.substr(0, length));
    for (int i = 0; i < 400; ++i) {
      std::string damaged = text;
      damaged[rng.Index(static_cast<int64_t>(text.size()))] = static_cast<char>(rng.Index(256));
      attempt(damaged);
    }
    EXPECT_GT(refused, 200) << ToString(format);
  }
}

TEST(Formats, TruncatedQcaIsNeverARig) {
  const std::string text(kQca);
  for (size_t length = 0; length + 20 < text.size(); ++length) {
    ASSERT_NE(Complaint(CalibrationFormat::kQca, text.substr(0, length)), "accepted") << length;
  }
}

TEST(Formats, AreDetectedByTheirContent) {
  const TempDir folder;
  const auto detect = [&](const std::string& name, const std::string& text) {
    WriteFileAtomic(folder / name, text);
    return DetectFormat(folder / name);
  };
  EXPECT_EQ(detect("a", kToml), CalibrationFormat::kToml);
  EXPECT_EQ(detect("b", kQca), CalibrationFormat::kQca);
  EXPECT_EQ(detect("c", kStereo), CalibrationFormat::kOpenCvYaml);
  EXPECT_EQ(detect("d", "{\"schema\": \"mvstudio.calibration/1\"}"), CalibrationFormat::kMvstudio);
  EXPECT_EQ(detect("e", "{\"cameras\": []}"), CalibrationFormat::kPanoptic);
  EXPECT_THROW(detect("f", "hello"), FormatError);
  EXPECT_THROW(detect("g", " \n"), FormatError);
  EXPECT_THROW(DetectFormat(folder / "none"), IoError);
  for (const auto format : kAllCalibrationFormats) {
    EXPECT_EQ(CalibrationFormatFromString(ToString(format)), format);
  }
}

TEST(RealFiles, QcaAndTomlGiveTheSameRig) {
  MVS_NEEDS_DATA("pose2sim");
  const std::string folder = DataRoot() + "/pose2sim/calibration/";
  EXPECT_EQ(DetectFormat(folder + "Calib.qca.txt"), CalibrationFormat::kQca);
  EXPECT_EQ(DetectFormat(folder + "Calib_qualisys.toml"), CalibrationFormat::kToml);
  ReadOptions as_pose2sim;
  as_pose2sim.qca_distortion_divisor = 64;
  const Rig qca = ReadQca(folder + "Calib.qca.txt", as_pose2sim).rig, toml = ReadToml(folder + "Calib_qualisys.toml").rig;
  ASSERT_EQ(toml.cameras.size(), 4u);
  ASSERT_EQ(qca.cameras.size(), 4u);
  for (size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(qca.cameras[i].camera.name, toml.cameras[i].camera.name);
    EXPECT_EQ(qca.cameras[i].camera.width_px, 1088);
    EXPECT_EQ(toml.cameras[i].camera.height_px, 1920);
    EXPECT_LT((qca.cameras[i].camera.params - toml.cameras[i].camera.params).norm(), 1e-9);
    EXPECT_LT(geometry::RotationAngle(qca.cameras[i].cam_from_world.rotation, toml.cameras[i].cam_from_world.rotation), 1e-13);
    EXPECT_LT((qca.cameras[i].cam_from_world.translation - toml.cameras[i].cam_from_world.translation).norm(), 1e-13);
    // Z is up: the cameras stand 1.5 to 2.5 m above the floor and look at the middle.
    EXPECT_NEAR(toml.cameras[i].CenterInWorld()[2], 2, 0.5);
    EXPECT_GT((toml.cameras[i].cam_from_world * Eigen::Vector3d(0, 0, 1))[2], 1);
  }
}

TEST(RealFiles, OpenCvSamples) {
  MVS_NEEDS_DATA("opencv_stereo");
  const std::string folder = DataRoot() + "/opencv_stereo/";
  const Rig left = ReadOpenCvYaml({folder + "left_intrinsics.yml"}).rig;
  ASSERT_EQ(left.cameras.size(), 1u);
  EXPECT_EQ(left.cameras[0].camera.model, LensModel::kBrown5);
  EXPECT_DOUBLE_EQ(left.cameras[0].camera.fx(), 535.91573396163199);
  EXPECT_DOUBLE_EQ(left.cameras[0].camera.params[8], 0.23839153080878486);
  EXPECT_EQ(left.cameras[0].camera.width_px, 640);
  const Rig old = ReadOpenCvYaml({folder + "out_camera_data.yml"}).rig;
  EXPECT_DOUBLE_EQ(old.cameras[0].camera.fx(), 657.46697810243404);
  EXPECT_EQ(old.cameras[0].camera.height_px, 480);
  EXPECT_THROW(ReadOpenCvYaml({folder + "intrinsics.yml"}), UsageError) << "has no image size";
  ReadOptions options;
  options.width_px = 640, options.height_px = 480;
  const ImportedRig stereo = ReadOpenCvYaml({folder + "intrinsics.yml"}, options);
  EXPECT_EQ(stereo.rig.cameras.size(), 2u);
  EXPECT_EQ(stereo.notes.at(0).code, "CAL-NOPOSE");
  EXPECT_THROW(ReadOpenCvYaml({folder + "calibration.yml"}, options), FormatError) << "holds a list of images only";
}

TEST(RealFiles, CaliscopeTomls) {
  MVS_NEEDS_DATA("caliscope");
  const std::string folder = DataRoot() + "/caliscope/sessions/post_optimization/";
  const Rig rig = ReadToml(folder + "camera_array.toml").rig;
  ASSERT_EQ(rig.cameras.size(), 4u);
  EXPECT_EQ(rig.cameras[0].camera.name, "cam_0");
  EXPECT_EQ(rig.cameras[0].camera.model, LensModel::kBrown5);
  const Rig config = ReadToml(folder + "config.toml").rig;
  const geometry::RigDifference difference = geometry::CompareRigs(config, rig);
  EXPECT_EQ(difference.max_focal_relative, 0);
}

/// A file that knows no late cameras looks like one of cameras in step.
TEST(CalibrationFormats, TimeOffsetsThatAreLostAreSaid) {
  const TempDir folder;
  Rig rig;
  for (const char* name : {"a", "b"}) {
    geometry::RigCamera camera;
    camera.camera = {name, LensModel::kPinhole, 640, 480, Eigen::Vector4d(500, 500, 320, 240), {}};
    rig.cameras.push_back(camera);
  }
  EXPECT_TRUE(WriteCalibration(rig, CalibrationFormat::kKalibr, folder / "in_step.yaml").notes.empty());
  rig.cameras[1].time_offset = geometry::TimeOffset{-0.3, 0.01};
  const ExportReport lost = WriteCalibration(rig, CalibrationFormat::kKalibr, folder / "late.yaml");
  ASSERT_EQ(lost.notes.size(), 1u);
  EXPECT_EQ(lost.notes[0].code, "CAL-OFFSETSLOST");
  EXPECT_THAT(lost.notes[0].text, HasSubstr("the time offsets of b have no place in kalibr"));
  EXPECT_TRUE(WriteCalibration(rig, CalibrationFormat::kMvstudio, folder / "late.json").notes.empty());
}

}  // namespace
}  // namespace mvstudio::calib
