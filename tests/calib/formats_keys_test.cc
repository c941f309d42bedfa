#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "calib/formats/formats.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/units.h"
#include "geometry/rig/meeting.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

/// Words of files that change what their numbers mean.
namespace mvstudio::calib {
namespace {

using geometry::LensModel;
using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;

ImportedRig ReadText(CalibrationFormat format, const std::string& text, const ReadOptions& options = {}) {
  const TempDir folder;
  const std::string path = folder / (format == CalibrationFormat::kNerfstudio ? "transforms.json" : "cam.yaml");
  WriteFileAtomic(path, text);
  EXPECT_EQ(DetectFormat(path), format) << text.substr(0, 80);
  return ReadCalibration(format, {path}, options);
}

std::string Refused(CalibrationFormat format, const std::string& text, const ReadOptions& options = {}) {
  return MessageOf<FormatError>([&] { ReadText(format, text, options); });
}

std::string CodesOf(const ImportedRig& imported) {
  std::string codes;
  for (const Notice& note : imported.notes) codes += note.code + " ";
  return codes;
}

constexpr char kPose[] = "\"transform_matrix\": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 2], [0, 0, 0, 1]]";

/// One frame; `head` are keys of the file, `own` of the frame.
std::string Transforms(const std::string& head, const std::string& own = "") {
  return "{\"fl_x\": 420, \"fl_y\": 420, \"cx\": 960, \"cy\": 540, \"w\": 1920, \"h\": 1080, \"k1\": 0.05, \"k2\": 0.01, " +
         head + "\"frames\": [{\"file_path\": \"images/c0.jpg\", " + own + kPose + "}]}";
}

/// Distance in px from the centre of a ray 45 degrees off the axis.
double RadiusAt45(const geometry::Camera& camera) {
  const geometry::Projection at = geometry::Projector(camera).Project({std::sqrt(0.5), 0, std::sqrt(0.5)});
  EXPECT_EQ(at.status, Status::kOk);
  return at.px.x() - camera.cx();
}

TEST(LensWordsOfFiles, FisheyesOfNerfstudioAndInstantNgp) {
  const double t = kPi / 4, t2 = t * t;
  const double fisheye = 420 * t * (1 + 0.05 * t2 + 0.01 * t2 * t2);  // OpenCV's formula for fisheye lenses
  const double brown = 420 * (1 + 0.05 + 0.01);                       // and for others: r = tan 45 degrees = 1
  for (const char* word :
       {"\"is_fisheye\": true, ", "\"camera_model\": \"OPENCV_FISHEYE\", ", "\"camera_model\": \"FISHEYE\", ",
        "\"camera_model\": \"opencv_fisheye\", \"is_fisheye\": true, ", "\"fisheye\": 1, "}) {
    const ImportedRig read = ReadText(CalibrationFormat::kNerfstudio, Transforms(word));
    EXPECT_NEAR(RadiusAt45(read.rig.cameras[0].camera), fisheye, 1e-9) << word;
  }
  for (const char* word :
       {"", "\"is_fisheye\": false, ", "\"camera_model\": \"OPENCV\", ", "\"camera_model\": \"PERSPECTIVE\", ",
        "\"camera_model\": \"RADIAL\", ", "\"camera_model\": null, "}) {
    const ImportedRig read = ReadText(CalibrationFormat::kNerfstudio, Transforms(word));
    EXPECT_NEAR(RadiusAt45(read.rig.cameras[0].camera), brown, 1e-9) << word;
  }
  // The frame's word counts before the file's.
  const ImportedRig own = ReadText(CalibrationFormat::kNerfstudio,
                                   Transforms("\"camera_model\": \"OPENCV\", ", "\"camera_model\": \"OPENCV_FISHEYE\", "));
  EXPECT_NEAR(RadiusAt45(own.rig.cameras[0].camera), fisheye, 1e-9);
  ReadOptions options;
  options.lens = geometry::LensKind::kFisheye;
  EXPECT_NEAR(RadiusAt45(ReadText(CalibrationFormat::kNerfstudio, Transforms(""), options).rig.cameras[0].camera), fisheye,
              1e-9);
  EXPECT_THAT(
      Refused(CalibrationFormat::kNerfstudio, Transforms("\"is_fisheye\": false, \"camera_model\": \"OPENCV\", "), options),
      HasSubstr("contradicts"));
}

TEST(LensWordsOfFiles, OtherLensesAreRefusedByName) {
  for (const char* word :
       {"\"camera_model\": \"EQUIRECTANGULAR\", ", "\"camera_model\": \"FISHEYE624\", ", "\"is_equirectangular\": true, ",
        "\"camera_model\": \"OPENCV\", \"lens_model\": \"fisheye\", ", "\"lens_type\": \"ftheta\", "}) {
    EXPECT_NE(Refused(CalibrationFormat::kNerfstudio, Transforms(word)), "") << word;
  }
}

TEST(KeysOfFiles, ThatChangeTheMeaningAreRefused) {
  for (const char* word : {"\"skew\": -5.8, ", "\"handedness\": \"left\", ", "\"coordinate_system\": \"opengl\", ",
                           "\"units\": \"mm\", ", "\"pose_type\": \"c2w\", ", "\"binning_x\": 2, "}) {
    EXPECT_THAT(Refused(CalibrationFormat::kNerfstudio, Transforms(word)), HasSubstr("take the key out")) << word;
  }
  for (const char* word : {"\"skew\": 0, ", "\"handedness\": \"right\", ", "\"units\": \"m\", ", "\"binning_x\": 1, "})
    EXPECT_EQ(ReadText(CalibrationFormat::kNerfstudio, Transforms(word)).rig.cameras.size(), 1u) << word;
  ReadOptions millimetres;
  millimetres.metres_per_unit = 1e-3;
  EXPECT_EQ(ReadText(CalibrationFormat::kNerfstudio, Transforms("\"units\": \"mm\", "), millimetres).rig.cameras.size(), 1u);
}

TEST(KeysOfFiles, ThatNobodyReadsAreNamed) {
  const ImportedRig read = ReadText(CalibrationFormat::kNerfstudio,
                                    Transforms("\"rolling_shutter\": [0, 0, 0, 0.03], \"aabb_scale\": 16, ", "\"tag\": 3, "));
  std::string text;
  for (const Notice& note : read.notes) text += note.code == "CAL-KEYS" ? note.text : "";
  EXPECT_THAT(text, ::testing::AllOf(HasSubstr("rolling_shutter"), HasSubstr("frames[0].tag")));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("aabb_scale")));
  EXPECT_THAT(CodesOf(ReadText(CalibrationFormat::kNerfstudio, Transforms(""))), ::testing::Not(HasSubstr("CAL-KEYS")));
}

TEST(KeysOfFiles, AppliedScaleIsUndone) {
  const ImportedRig read =
      ReadText(CalibrationFormat::kNerfstudio,
               Transforms("\"applied_scale\": 0.5, \"applied_transform\": [[0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0]], "));
  EXPECT_NEAR(read.rig.cameras[0].CenterInWorld().z(), 4, 1e-12);
  EXPECT_THAT(CodesOf(read), ::testing::AllOf(HasSubstr("CAL-SCALED"), HasSubstr("CAL-TURNED")));
}

/// ROS's camera_info, and what OpenCV's functions write from Python.
std::string Ros(const std::string& words, const std::string& distortion = "[0.1, -0.03, 0.004, -0.007]") {
  return "image_width: 640\nimage_height: 480\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [400, 0, 320, 0, 400, 240, 0, 0, "
         "1]\n" +
         words + "distortion_coefficients:\n  rows: 1\n  cols: 4\n  data: " + distortion + "\n";
}

/// A frame's own lens, in the ways that programs write it beside the file's; pixels from a corner.
TEST(KeysOfFiles, LensesOfAFrame) {
  const auto params = [](const std::string& own) {
    return Eigen::VectorXd(ReadText(CalibrationFormat::kNerfstudio, Transforms("", own)).rig.cameras[0].camera.params.head(4));
  };
  const Eigen::Vector4d theirs(500, 510, 949.5, 529.5), of_file(420, 420, 959.5, 539.5);
  for (const std::string own :
       {"[500, 510, 950, 530]", "[[500, 0, 950], [0, 510, 530], [0, 0, 1]]", "[500, 0, 950, 0, 510, 530, 0, 0, 1]",
        "[[500, 0, 950, 0], [0, 510, 530, 0], [0, 0, 1, 0], [0, 0, 0, 1]]",
        "[500, 0, 950, 0, 0, 510, 530, 0, 0, 0, 1, 0, 0, 0, 0, 1]"})
    EXPECT_EQ(params("\"intrinsics\": " + own + ", "), theirs) << own;
  EXPECT_EQ(params("\"intrinsics\": [1, 2], "), of_file);
  EXPECT_EQ(params(""), of_file);
}

TEST(LensWordsOfFiles, OfRosAndOpenCv) {
  for (const std::string head : {"", "%YAML:1.0\n---\n"}) {
    for (const char* word : {"camera_model: fisheye\n", "distortion_model: equidistant\n", "fisheye_model: 1\n"}) {
      EXPECT_EQ(ReadText(CalibrationFormat::kOpenCvYaml, head + Ros(word)).rig.cameras[0].camera.model,
                LensModel::kKannalaBrandt4)
          << word;
    }
    for (const char* word : {"", "distortion_model: plumb_bob\n", "camera_model: pinhole\n"}) {
      EXPECT_EQ(ReadText(CalibrationFormat::kOpenCvYaml, head + Ros(word)).rig.cameras[0].camera.model, LensModel::kBrown4)
          << word;
    }
    EXPECT_NE(Refused(CalibrationFormat::kOpenCvYaml, head + Ros("distortion_model: division\n")), "");
    EXPECT_NE(Refused(CalibrationFormat::kOpenCvYaml, head + Ros("binning_x: 2\n")), "");
  }
  const std::string python =
      "{\"camera_matrix\": [[400, 0, 320], [0, 400, 240], [0, 0, 1]], \"dist_coeffs\": [[0.1, -0.03, 0.004, -0.007, 0]], "
      "\"image_size\": [640, 480]}";
  const geometry::Camera camera = ReadText(CalibrationFormat::kOpenCvYaml, python).rig.cameras[0].camera;
  EXPECT_EQ(camera.width_px, 640);
  EXPECT_EQ(camera.params.tail(5)[3], -0.007);
}

/// Files as ROS's programs wrote or print them.
TEST(LensWordsOfFiles, OfRosInItsOwnSpellings) {
  const auto params = [](const std::string& text) {
    return Eigen::VectorXd(ReadText(CalibrationFormat::kOpenCvYaml, text).rig.cameras[0].camera.params);
  };
  const Eigen::VectorXd plain = params(Ros("distortion_model: plumb_bob\n"));
  EXPECT_EQ(params(Ros("distortion_model: plumb_bob\n", "[0.1 -0.03 0.004 -0.007]")), plain) << "blanks for commas";
  const std::string cols5 = Ros("distortion_model: rational_polynomial\n", "[0.1, 0, 0.004, -0.007, 0.2, 0.3, 0, 0.01]");
  std::string text = cols5;
  EXPECT_EQ(params(text.replace(text.find("cols: 4"), 7, "cols: 5")).tail(1)[0], 0.01) << "cols: 5 for every lens";
  EXPECT_THAT(Refused(CalibrationFormat::kOpenCvYaml, cols5), HasSubstr("8 numbers for 1 x 4"));
  const auto echo = [&](const std::string& k, const std::string& d) {
    return "header:\n  frame_id: cam\nheight: 480\nwidth: 640\ndistortion_model: plumb_bob\n" + d +
           ":\n- 0.1\n- -0.03\n- 0.004\n- -0.007\n- 0.0\n" + k +
           ": [400, 0, 320, 0, 400, 240, 0, 0, 1]\nr: [1, 0, 0, 0, 1, 0, 0, 0, 1]\nbinning_x: 0\n---\n";
  };
  for (const std::string& message : {echo("k", "d"), echo("K", "D")}) EXPECT_EQ(params(message).head(8), plain);
}

/// What a file says twice, or in another unit, in formats of each kind.
TEST(FilesThatContradictThemselves, AreRefusedByName) {
  const TempDir folder;
  const auto refused = [&](CalibrationFormat format, const std::string& name, const std::string& text) {
    WriteFileAtomic(folder / name, text);
    return MessageOf<FormatError>([&] { ReadCalibration(format, {folder / name}); });
  };
  const auto toml = [](const char* rotation, const char* metadata) {
    return std::string("[a]\nsize = [640, 480]\nmatrix = [[400.0, 0.0, 320.0], [0.0, 400.0, 240.0], [0.0, 0.0, 1.0]]\n") +
           "distortions = [0.1, 0.0, 0.0, 0.0]\nrotation = " + rotation + "\ntranslation = [0.0, 0.0, 1.0]\n" + metadata;
  };
  using Format = CalibrationFormat;
  EXPECT_THAT(refused(Format::kToml, "a.toml", toml("[90.0, 0.0, 0.0]", "")), HasSubstr("a.rotation: a rotation vector of 90"));
  EXPECT_THAT(refused(Format::kToml, "b.toml", toml("[0.0, 0.0, 0.0]", "[metadata]\nunits = \"mm\"\n")),
              HasSubstr("metadata.units: 'mm' is not the unit"));
  WriteFileAtomic(folder / "c.toml", toml("[6.0, 0.0, 0.0]", "[metadata]\nadjusted = false\nerror = 0.5\n"));
  EXPECT_EQ(CodesOf(ReadToml(folder / "c.toml")), "");

  const auto matrix = [](const char* key, const char* size, const char* data) {
    return std::string(key) + ": !!opencv-matrix\n  " + size + "\n  dt: d\n  data: [" + data + "]\n";
  };
  const std::string k = matrix("camera_matrix", "rows: 3\n  cols: 3", "400, 0, 320, 0, 400, 240, 0, 0, 1"),
                    d = matrix("distortion_coefficients", "rows: 1\n  cols: 4", "0.1, 0, 0, 0");
  const std::string head = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n";
  EXPECT_THAT(refused(Format::kOpenCvYaml, "a.yml", head + k + d + "xi: 1.2\n"), HasSubstr("omnidirectional lens"));
  EXPECT_THAT(
      refused(Format::kOpenCvYaml, "b.yml",
              head + k + d + matrix("R", "rows: 3\n  cols: 1", "0, 45, 0") + matrix("T", "rows: 3\n  cols: 1", "0, 0, 1")),
      HasSubstr("are these degrees?"));
  const std::string models =
      "{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [400, 400, 320, 240], 'imagersize': [640, 480], ";
  EXPECT_THAT(refused(Format::kMrcal, "a.cameramodel", models + "'extrinsics': [0, 0, 90, 0, 0, 1]}"), HasSubstr("degrees?"));
  EXPECT_THAT(
      refused(Format::kMrcal, "b.cameramodel", models + "'extrinsics': [0, 0, 1, 0, 0, 1], 'rt_cam_ref': [0, 0, 1, 0, 0, 2]}"),
      HasSubstr("another pose than extrinsics"));

  const auto qca = [](const char* type, const char* active) {
    return std::string("<calibration type=\"") + type + "\"><cameras><camera serial=\"1\" active=\"" + active +
           "\"><fov_video left=\"0\" top=\"0\" right=\"1919\" bottom=\"1079\"/><transform r11=\"1\" r12=\"0\" r13=\"0\" "
           "r21=\"0\" r22=\"-1\" r23=\"0\" r31=\"0\" r32=\"0\" r33=\"-1\" x=\"0\" y=\"0\" z=\"2000\"/><intrinsic "
           "focalLengthU=\"64000\" focalLengthV=\"64000\" centerPointU=\"61440\" centerPointV=\"34560\" skew=\"0\" "
           "radialDistortion1=\"0\" radialDistortion2=\"0\" tangentalDistortion1=\"0\" tangentalDistortion2=\"0\"/></camera>"
           "</cameras></calibration>";
  };
  EXPECT_THAT(refused(Format::kQca, "a.qca.txt", qca("fisheye", "1")), HasSubstr("calibration.type: says that the lenses"));
  WriteFileAtomic(folder / "b.qca.txt", qca("regular", "0"));
  EXPECT_EQ(CodesOf(ReadQca(folder / "b.qca.txt")), "CAL-INACTIVE ");

  const std::string names = "%YAML:1.0\n---\nnames:\n  - \"1\"\n";
  WriteFileAtomic(folder / "intri.yml",
                  names + matrix("K_1", "rows: 3\n  cols: 3", "400, 0, 320, 0, 400, 240, 0, 0, 1") + "H_1: 480\nW_1: 640\n");
  WriteFileAtomic(folder / "extri.yml", names + matrix("R_1", "rows: 3\n  cols: 1", "0, 1, 0") +
                                            matrix("Rot_1", "rows: 3\n  cols: 3", "1, 0, 0, 0, 1, 0, 0, 0, 1") +
                                            matrix("T_1", "rows: 3\n  cols: 1", "0, 0, 1"));
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadEasyMocap({folder.path()}); }),
              HasSubstr("Rot_1: is another rotation than R_1"));
}

TEST(LensWordsOfFiles, AColumnOfFourNeedsAWord) {
  const std::string column =
      "%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 302, 0, 496, 0, 320, 331, "
      "0, 0, 1 "
      "]\ndist_coeffs: !!opencv-matrix\n   rows: 4\n   cols: 1\n   dt: d\n   data: [ -0.0437, 0.0217, -0.0264, 0.0084 ]\n"
      "resolution: !!opencv-matrix\n   rows: 2\n   cols: 1\n   dt: i\n   data: [ 960, 640 ]\n";
  EXPECT_THAT(Refused(CalibrationFormat::kOpenCvYaml, column), HasSubstr("option 'lens' fisheye or perspective"));
  ReadOptions options;
  options.lens = geometry::LensKind::kFisheye;
  const geometry::Camera camera = ReadText(CalibrationFormat::kOpenCvYaml, column, options).rig.cameras[0].camera;
  EXPECT_EQ(camera.model, LensModel::kKannalaBrandt4);
  EXPECT_EQ(camera.height_px, 640);
}

/// k1 … k4 alone are a fisheye's, with p1 and p2 a perspective lens's.
TEST(LensWordsOfFiles, SingleTermsUpToTheFourthNeedAWord) {
  const auto text = [](const std::string& terms) {
    return "{\"camera_matrix\": [[400, 0, 320], [0, 400, 240], [0, 0, 1]], \"image_size\": [640, 480], \"k1\": -0.04, "
           "\"k2\": 0.02, \"k3\": -0.03, " +
           terms + "}";
  };
  const auto model = [&](const std::string& terms, const ReadOptions& options) {
    return ReadText(CalibrationFormat::kOpenCvYaml, text(terms), options).rig.cameras[0].camera.model;
  };
  EXPECT_THAT(Refused(CalibrationFormat::kOpenCvYaml, text("\"k4\": 0.008")),
              HasSubstr("option 'lens' fisheye or perspective"));
  ReadOptions options;
  options.lens = geometry::LensKind::kFisheye;
  EXPECT_EQ(model("\"k4\": 0.008", options), LensModel::kKannalaBrandt4);
  options.lens = geometry::LensKind::kPerspective;
  EXPECT_EQ(model("\"k4\": 0.008", options), LensModel::kRational8);
  EXPECT_EQ(model("\"k4\": 0.008, \"p1\": 0.001, \"p2\": 0", {}), LensModel::kRational8);
  EXPECT_EQ(model("\"k4\": 0", {}), LensModel::kBrown5);
}

/// A ray's pixel by the matrix with skew, and through what is read.
TEST(Skew, TheNearestCameraIsWithinItsError) {
  const std::string text =
      Ros("distortion_model: plumb_bob\nR:\n  rows: 3\n  cols: 1\n  data: [0.1, 0.2, 0.3]\nT:\n  rows: 3\n  cols: 1\n"
          "  data: [0, 0, 2]\n");
  std::string skewed = text;
  skewed.replace(skewed.find("[400, 0, 320"), 12, "[400, 4, 320");
  EXPECT_THAT(Refused(CalibrationFormat::kOpenCvYaml, skewed), HasSubstr("allow-approximation"));
  ReadOptions options;
  options.allow_approximation_px = 5;
  const geometry::RigCamera plain = ReadText(CalibrationFormat::kOpenCvYaml, text).rig.cameras[0];
  const ImportedRig read = ReadText(CalibrationFormat::kOpenCvYaml, skewed, options);
  ASSERT_THAT(CodesOf(read), HasSubstr("CAL-APPROXIMATED"));
  double worst = 0;
  for (const double x : {-0.4, 0.0, 0.4}) {
    for (const double y : {-0.3, 0.0, 0.3}) {
      const Eigen::Vector3d x_in_world = Inverse(plain.cam_from_world) * Eigen::Vector3d(2 * x, 2 * y, 2);
      Eigen::Vector2d truth = geometry::Projector(plain.camera).Project(plain.cam_from_world * x_in_world).px;
      truth.x() += 4 * (truth.y() - plain.camera.cy()) / plain.camera.fy();
      const geometry::RigCamera& camera = read.rig.cameras[0];
      const auto projected = geometry::Projector(camera.camera).Project(camera.cam_from_world * x_in_world);
      worst = std::max(worst, (projected.px - truth).norm());
    }
  }
  EXPECT_LT(worst,
            0.6 * 4 * 0.5);  // half of what leaving the skew out costs at the corner: 4 px times y = 0.3, and the other axis
  EXPECT_GT(worst, 0.1);
}

}  // namespace
}  // namespace mvstudio::calib
