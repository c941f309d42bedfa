#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "calib/formats/formats.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::calib {
namespace {

using mvstudio::testing::MessageOf;
using mvstudio::testing::TempDir;
using ::testing::HasSubstr;

/// OpenCV's text of a matrix, `margin` blanks from the left.
std::string Stored(const std::string& margin, const std::string& key, int rows, int cols, const std::string& numbers) {
  return margin + key + ": !!opencv-matrix\n" + margin + "   rows: " + std::to_string(rows) + "\n" + margin +
         "   cols: " + std::to_string(cols) + "\n" + margin + "   dt: d\n" + margin + "   data: [ " + numbers + " ]\n";
}

std::string Lens(const std::string& margin, const std::string& focal) {
  return Stored(margin, "K", 3, 3, focal + "., 0., 640., 0., " + focal + "., 360., 0., 0., 1.") +
         Stored(margin, "dist", 1, 5, "-0.1, 0.01, 0., 0., 0.");
}

std::string PoseAt(const std::string& margin, const std::string& x) {
  return Stored(margin, "R", 3, 3, "1., 0., 0., 0., 1., 0., 0., 0., 1.") + Stored(margin, "T", 3, 1, x + ", 0., 0.");
}

class NestedOpenCv : public ::testing::Test {
 protected:
  ImportedRig Read(const std::string& text, const std::string& name = "a.yaml") {
    WriteFileAtomic(folder_ / name, text);
    ReadOptions options;
    options.width_px = 1280, options.height_px = 720;
    return ReadCalibration(DetectFormat(folder_ / name), {folder_ / name}, options);
  }
  /// Two cameras of focal lengths 800 and 810, the second a metre to the right.
  void ExpectTwo(const ImportedRig& imported, const std::string& first, const std::string& second) {
    const auto& cameras = imported.rig.cameras;
    ASSERT_EQ(cameras.size(), 2u);
    EXPECT_EQ(cameras[0].camera.name, first);
    EXPECT_EQ(cameras[1].camera.name, second);
    EXPECT_EQ(cameras[0].camera.fx(), 800);
    EXPECT_EQ(cameras[1].camera.fx(), 810);
    EXPECT_EQ(cameras[0].camera.params[4], -0.1);
    EXPECT_EQ(cameras[1].CenterInWorld(), Eigen::Vector3d(1, 0, 0));
  }
  TempDir folder_;
  const std::string head_ = "%YAML:1.0\n---\n";
};

TEST_F(NestedOpenCv, TablesByNameAndInATableAndInAList) {
  const std::string m = "   ", mm = "      ";
  ExpectTwo(Read(head_ + "cam0:\n" + Lens(m, "800") + PoseAt(m, "0.") + "cam1:\n" + Lens(m, "810") + PoseAt(m, "-1.")), "cam0",
            "cam1");
  ExpectTwo(Read(head_ + "cameras:\n   cam0:\n" + Lens(mm, "800") + PoseAt(mm, "0.") + "   cam1:\n" + Lens(mm, "810") +
                 PoseAt(mm, "-1.")),
            "cam0", "cam1");
  ExpectTwo(Read(head_ + "number: 2\ncameras:\n   -\n      name: left\n" + Lens(mm, "800") + PoseAt(mm, "0.") + "   -\n" +
                 Lens(mm, "810") + PoseAt(mm, "-1.")),
            "left", "cameras1");
  ExpectTwo(Read(head_ + "cam0:\n" + Lens(m, "800") + "cam1:\n" + Lens(m, "810") + PoseAt("", "-1.")), "cam0", "cam1");
}

TEST_F(NestedOpenCv, XmlListsItsTablesByUnderscores) {
  const auto matrix = [](const std::string& key, const std::string& size, const std::string& numbers) {
    return "<" + key + " type_id=\"opencv-matrix\">" + size + "<dt>d</dt><data>" + numbers + "</data></" + key + ">";
  };
  const auto camera = [&](const std::string& focal, const std::string& x) {
    return "<_>" + matrix("K", "<rows>3</rows><cols>3</cols>", focal + ". 0. 640. 0. " + focal + ". 360. 0. 0. 1.") +
           matrix("dist", "<rows>1</rows><cols>5</cols>", "-0.1 0.01 0. 0. 0.") +
           matrix("R", "<rows>3</rows><cols>3</cols>", "1. 0. 0. 0. 1. 0. 0. 0. 1.") +
           matrix("T", "<rows>3</rows><cols>1</cols>", x + " 0. 0.") + "</_>";
  };
  ExpectTwo(Read("<?xml version=\"1.0\"?>\n<opencv_storage>\n<cameras>" + camera("800", "0.") + camera("810", "-1.") +
                     "</cameras>\n</opencv_storage>\n",
                 "a.xml"),
            "cameras0", "cameras1");
}

/// Python writes lists of lists, of cameras too, and parts a camera into its lens and its place.
TEST_F(NestedOpenCv, JsonOfPython) {
  const auto lens = [](const std::string& matrix, const std::string& focal) {
    return "\"" + matrix + "\": [[" + focal + ", 0, 640], [0, " + focal +
           ", 360], [0, 0, 1]], \"dist\": [[-0.1, 0.01, 0, 0, 0]]";
  };
  const auto pose = [](const std::string& x) {
    return "\"R\": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], \"t\": [[" + x + "], [0], [0]]";
  };
  const std::string a = lens("K", "800") + ", " + pose("0"), b = lens("K", "810") + ", " + pose("-1");
  ExpectTwo(Read("{\"cam0\": {" + a + "}, \"cam1\": {" + b + "}}", "a.json"), "cam0", "cam1");
  ExpectTwo(Read("[{" + a + "}, {" + b + "}]", "a.json"), "cam0", "cam1");
  const auto parted = [&](const std::string& focal, const std::string& x) {
    return "{\"intrinsics\": {" + lens("camera_matrix", focal) + "}, \"extrinsics\": {" + pose(x) + "}}";
  };
  ExpectTwo(Read("{\"cam0\": " + parted("800", "0") + ", \"cam1\": " + parted("810", "-1") + "}", "a.json"), "cam0", "cam1");
  EXPECT_THAT(MessageOf<FormatError>(
                  [&] { Read("{\"raw\": {\"cam0\": {" + a + "}}, \"rectified\": {\"cam0\": {" + b + "}}}", "a.json"); }),
              ::testing::AllOf(HasSubstr("raw.cam0"), HasSubstr("rectified.cam0")));
}

TEST_F(NestedOpenCv, WhatIsNotKnownIsRefusedByItsPath) {
  const auto refused = [&](const std::string& text) { return MessageOf<FormatError>([&] { Read(head_ + text); }); };
  const std::string m = "   ", mm = "      ";
  EXPECT_THAT(refused("cam0:\n" + Stored(m, "lens", 3, 3, "800., 0., 640., 0., 800., 360., 0., 0., 1.")),
              HasSubstr("cam0.lens"));
  EXPECT_THAT(refused("cameras:\n   cam0:\n" + Lens(mm, "800") + "   cam1:\n" + Stored(mm, "lens", 1, 1, "1.")),
              HasSubstr("cameras.cam1"));
  EXPECT_THAT(refused("cam0:\n" + Lens(m, "800") + PoseAt(m, "0.") + "cam1:\n" + Lens(m, "810")), HasSubstr("all or none"));
  EXPECT_THAT(refused("cam0:\n" + Stored(m, "K", 3, 3, "800., 0.") + "cam1:\n" + Lens(m, "810")), HasSubstr("cam0.K"));
}

/// Names of both cameras' lenses in one table, by the side behind or before them.
struct StereoNames {
  const char *matrix[2], *distortion[2], *rotation, *translation;
};

std::string StereoText(const StereoNames& names) {
  std::string text = "%YAML:1.0\n---\n";
  for (const int side : {0, 1}) {
    const std::string focal = side ? "810" : "800";
    text += Stored("", names.matrix[side], 3, 3, focal + "., 0., 640., 0., " + focal + "., 360., 0., 0., 1.") +
            Stored("", names.distortion[side], 1, 5, "-0.1, 0.01, 0., 0., 0.");
  }
  return text + Stored("", names.rotation, 3, 3, "1., 0., 0., 0., 1., 0., 0., 0., 1.") +
         Stored("", names.translation, 3, 1, "-1., 0., 0.");
}

TEST_F(NestedOpenCv, StereoPairsByManyNames) {
  for (const StereoNames& names : {StereoNames{{"M1", "M2"}, {"D1", "D2"}, "R", "T"},
                                   {{"camera_matrix_left", "camera_matrix_right"},
                                    {"distortion_coeffs_left", "distortion_coeffs_right"},
                                    "rotation_matrix",
                                    "translation_vector"},
                                   {{"left_camera_matrix", "right_camera_matrix"},
                                    {"left_distortion_coefficients", "right_distortion_coefficients"},
                                    "R",
                                    "T"},
                                   {{"mtxL", "mtxR"}, {"distL", "distR"}, "Rot", "Trans"},
                                   {{"K0", "K1"}, {"D0", "D1"}, "rotation", "translation"}})
    ExpectTwo(Read(StereoText(names)), "left", "right");
}

TEST_F(NestedOpenCv, DistortionByAnUnknownNameIsRefusedNotDropped) {
  const auto refused = [&](const char* left, const char* right) {
    const StereoNames names{{"M1", "M2"}, {left, right}, "R", "T"};
    return MessageOf<FormatError>([&] { Read(StereoText(names)); });
  };
  EXPECT_THAT(refused("my_distortion_a", "my_distortion_b"), HasSubstr("distortion_coefficients"));
  EXPECT_THAT(refused("D1", "distortion_b"), HasSubstr("the other camera has no coefficients"));
  for (const char* harmless : {"distortion_std", "undistorted_size", "num_distortion_coeffs"}) {
    const std::string text = StereoText({{"M1", "M2"}, {"D1", "D2"}, "R", "T"}) + Stored("", harmless, 1, 2, "0.1, 0.2");
    ExpectTwo(Read(text), "left", "right");
  }
}

}  // namespace
}  // namespace mvstudio::calib
