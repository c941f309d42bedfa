#include "dataset/verify/verify.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/verify/image_mask.h"
#include "tests/dataset/dataset_test_util.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;

/// A sound dataset: two cameras, three frames, one standing person, masks that are a box around the joints.
class VerifyTest : public ::testing::Test {
 protected:
  VerifyTest() {
    geometry::Rig rig;
    for (int c = 0; c < 2; ++c) {
      geometry::RigCamera camera;
      camera.camera = geometry::MakePinhole("00_0" + std::to_string(c), 80, 60, 70);
      Eigen::Matrix3d axes;  // looks along +y from y = -4 m
      axes << 1, 0, 0, 0, 0, -1, 0, 1, 0;
      camera.cam_from_world.rotation = Eigen::Quaterniond(axes);
      camera.cam_from_world.translation = Eigen::Vector3d(0.1 * c, 1.0, 4.0);
      rig.cameras.push_back(camera);
    }
    WritePanopticCalibration(rig, Path("calibration_t.json"), "test");
    Coco19Pose pose;
    for (int j = 0; j < 19; ++j) {
      pose.x_in_world.col(j) << 0.02 * (j - 9), 0, 1.5 - 0.05 * j;
      pose.valid[j] = true;
      pose.confidence[j] = 0.9;
    }
    pose.x_in_world.col(0) << 0, 0, 1.5;
    pose.x_in_world.col(2) << 0, 0, 1.0;
    for (int frame = 5; frame < 8; ++frame) {
      WriteBody3dScene({{0, pose}}, 33.0 * frame,
                       Path("hdPose3d_stage1_coco19/body3DScene_0000000" + std::to_string(frame) + ".json"));
      for (const std::string c : {"00_00", "00_01"}) {
        const std::string name = c + "/" + c + "_0000000" + std::to_string(frame);
        WriteImage(SmoothImage(80, 60, frame + (c == "00_01" ? 2 : 0)), Path("hdImgs/" + name + ".jpg"));
        Image mask(80, 60, 1);
        for (int y = 15; y < 50; ++y) std::fill_n(mask.Pixel(25, y), 32, uint8_t{255});
        WriteImage(mask, Path("masks/" + name + ".png"));
      }
    }
  }
  std::string Path(const std::string& name) const { return folder_ / name; }
  std::string Image0(int frame) const { return Path("hdImgs/00_00/00_00_0000000" + std::to_string(frame) + ".jpg"); }
  std::string Mask0(int frame) const { return Path("masks/00_00/00_00_0000000" + std::to_string(frame) + ".png"); }
  std::string Scene(int frame) const {
    return Path("hdPose3d_stage1_coco19/body3DScene_0000000" + std::to_string(frame) + ".json");
  }
  void EditJson(const std::string& path, const std::function<void(json&)>& change) const {
    json value = json::parse(ReadFile(path));
    change(value);
    WriteFileAtomic(path, value.dump());
  }
  /// Number of findings with the code; every other finding is a failure.
  int Only(const std::string& code) const {
    int count = 0;
    for (const Finding& f : VerifyDataset(folder_.path()).findings) {
      count += f.code == code;
      EXPECT_EQ(f.code, code) << f.path << ": " << f.text;
    }
    return count;
  }

  mvstudio::testing::TempDir folder_;
};

TEST_F(VerifyTest, SoundDatasetHasNoFinding) {
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(Only("none"), 0);
  EXPECT_EQ(report.cameras, 2);
  EXPECT_EQ(report.frames, 3);
  EXPECT_EQ(report.images, 6);
  EXPECT_EQ(report.masks, 6);
}

TEST_F(VerifyTest, EveryFaultyCameraIsListed) {
  EditJson(Path("calibration_t.json"), [](json& c) {
    c["cameras"][0]["R"][0][0] = 2.5;
    c["cameras"][1].erase("distCoef");
  });
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(
      std::count_if(report.findings.begin(), report.findings.end(), [](const Finding& f) { return f.code == "DAT-CALIB"; }), 2);
  EXPECT_GE(report.num_errors(), 2);
}

TEST_F(VerifyTest, MirroredAxesAreFound) {
  EditJson(Path("calibration_t.json"), [](json& c) {
    for (auto& row : c["cameras"][0]["R"]) row[2] = -row[2].get<double>();
  });
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.findings.at(0).code, "DAT-CALIB");
  EXPECT_NE(report.findings.at(0).text.find("determinant"), std::string::npos);
}

TEST_F(VerifyTest, ImageOfAnotherSize) {
  WriteImage(SmoothImage(82, 60, 0), Image0(6));
  EXPECT_EQ(Only("DAT-SIZE"), 1);
}

TEST_F(VerifyTest, MissingImage) {
  fs::remove(Image0(6));
  EXPECT_EQ(Only("DAT-IMAGE-MISSING"), 1);
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.num_errors(), 0) << "a dataset need not hold every picture";
  EXPECT_EQ(report.findings.at(0).text, "no image for 1 of 3 frames with joints; 1 frame: 6");
  EXPECT_EQ(report.no_image, (std::map<std::string, int>{{"00_00", 1}}));
  EXPECT_TRUE(report.no_mask.empty()) << "the mask of a picture that is not there is not missed";
}

TEST_F(VerifyTest, ACameraWithoutAnyImage) {
  const auto later = [&](int frame) { return Path("hdImgs/00_00/00_00_0000001" + std::to_string(frame) + ".jpg"); };
  for (int frame = 5; frame < 8; ++frame) fs::rename(Image0(frame), later(frame));
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.num_errors(), 1);
  EXPECT_EQ(report.no_image.at("00_00"), 3);
  for (int frame = 5; frame < 8; ++frame) fs::remove(later(frame));
  EXPECT_EQ(Only("DAT-IMAGE"), 1) << "an empty folder";
  EXPECT_EQ(VerifyDataset(folder_.path()).num_errors(), 1);
  fs::remove_all(Path("hdImgs/00_00"));
  EXPECT_EQ(Only("DAT-IMAGE"), 1);
  EXPECT_EQ(VerifyDataset(folder_.path()).num_errors(), 0) << "calibrations often list cameras that were not fetched";
}

TEST_F(VerifyTest, DamagedImage) {
  Truncate(Image0(6), Path("cut"), 0.7);
  fs::rename(Path("cut"), Image0(6));
  EXPECT_EQ(Only("DAT-IMAGE"), 1);
}

TEST_F(VerifyTest, MissingMask) {
  fs::remove(Mask0(7));
  EXPECT_EQ(Only("DAT-MASK-MISSING"), 1);
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.num_errors(), 0);
  EXPECT_EQ(report.no_mask, (std::map<std::string, int>{{"00_00", 1}}));
  fs::remove(Mask0(5)), fs::remove(Mask0(6));
  EXPECT_EQ(Only("DAT-MASK-MISSING"), 1);
  EXPECT_EQ(VerifyDataset(folder_.path()).num_errors(), 1) << "the other camera has masks";
}

TEST_F(VerifyTest, GreyMask) {
  WriteImage(Image(80, 60, 1, 200), Mask0(5));
  EXPECT_EQ(Only("DAT-MASK-BINARY"), 1);
}

TEST_F(VerifyTest, MasksOfZeroAndOneAreReadAndSaid) {
  for (const char* camera : {"00_00", "00_01"}) {
    for (int frame = 5; frame < 8; ++frame) {
      const std::string path =
          Path(std::string("masks/") + camera + "/" + camera + "_0000000" + std::to_string(frame) + ".png");
      Image mask = ReadImage(path, true);
      for (uint8_t& value : mask.pixels) value = value > 0;
      WriteImage(mask, path);
    }
  }
  EXPECT_EQ(Only("DAT-MASK-BINARY"), 1) << "and no DAT-COVER, no DAT-MASK-EMPTY";
  EXPECT_EQ(VerifyDataset(folder_.path()).num_errors(), 0);
}

TEST_F(VerifyTest, MaskOfAnotherSize) {
  WriteImage(Image(40, 30, 1, 255), Mask0(5));
  EXPECT_EQ(Only("DAT-MASK-SIZE"), 1);
}

TEST_F(VerifyTest, EmptyMask) {
  WriteImage(Image(80, 60, 1, 0), Mask0(5));
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.num_errors(), 0);
  EXPECT_EQ(report.findings.at(0).code, "DAT-MASK-EMPTY");
}

TEST_F(VerifyTest, JointsOffTheMasks) {
  for (int frame = 5; frame < 8; ++frame) {
    Image mask(80, 60, 1);
    for (int y = 0; y < 10; ++y) std::fill_n(mask.Pixel(0, y), 10, uint8_t{255});
    WriteImage(mask, Mask0(frame));
  }
  EXPECT_EQ(Only("DAT-COVER"), 1);
  EXPECT_EQ(VerifyDataset(folder_.path()).num_errors(), 1) << "none of them lies on one";
}

/// What a mask shows in place of the person names the reason.
TEST_F(VerifyTest, MasksOfSomethingElseThanThePersonAreNamed) {
  const auto because = [&](const std::function<bool(int x, int y)>& on) {
    for (int frame = 5; frame < 8; ++frame) {
      Image mask(80, 60, 1);
      for (int y = 0; y < 60; ++y) {
        for (int x = 0; x < 80; ++x) *mask.Pixel(x, y) = on(x, y) ? 255 : 0;
      }
      WriteImage(mask, Mask0(frame));
    }
    std::string texts;
    for (const Finding& finding : VerifyDataset(folder_.path()).findings) {
      if (finding.code == "DAT-COVER") texts += finding.text;
    }
    return texts;
  };
  const auto person = [](int x, int y) { return x >= 25 && x < 57 && y >= 15 && y < 50; };
  EXPECT_EQ(because(person), "");
  EXPECT_THAT(because([](int, int) { return true; }), HasSubstr("cover the whole image"));
  EXPECT_THAT(because([](int, int) { return false; }), HasSubstr("empty"));
  EXPECT_THAT(because([&](int x, int y) { return !person(x, y); }), HasSubstr("inverted"));
  // All joints but one lie along this line.
  const auto line = [](double x, double y) { return std::abs(x - (39.5 + 0.4 * (y - 28.6))) <= 1.5; };
  EXPECT_EQ(because([&](int x, int y) { return line(x, y); }), "");
  EXPECT_THAT(because([&](int x, int y) { return line(79 - x, y); }), HasSubstr("mirrored"));
}

/// Images and masks of a box that moves, of two cameras in ten frames; `image_of` and `late` choose what the images show.
class ImageMaskTest : public ::testing::Test {
 protected:
  std::vector<Finding> Found(const std::function<int(int)>& image_of, int late, int speed_px = 4) {
    PanopticDataset data;
    data.root = folder_.path();
    CameraFrames frames;
    for (int c = 0; c < 2; ++c) {
      const std::string name = "00_0" + std::to_string(c);
      for (int frame = 0; frame < 10; ++frame) {
        frames[name].push_back(frame);
        const std::string stem = name + "/" + name + "_0000000" + std::to_string(frame) + ".png";
        Image image = SmoothImage(160, 120, c), mask(160, 120, 1);
        Box(&image, image_of(c), speed_px * (frame - late), 250), Box(&mask, c, speed_px * frame, 255);
        WriteImage(image, folder_ / ("hdImgs/" + stem)), WriteImage(mask, folder_ / ("masks/" + stem));
      }
    }
    return CompareImagesWithMasks(data, {}, frames, {});
  }
  static void Box(Image* image, int camera, int x, uint8_t value) {
    for (int y = 20 + 15 * camera; y < 90; ++y)
      std::fill_n(image->Pixel(40 + x + 20 * camera, y), (20 + 9 * camera) * image->channels, value);
  }
  mvstudio::testing::TempDir folder_;
};

TEST_F(ImageMaskTest, WhatBelongsTogetherAndWhatStandsStillGivesNone) {
  const auto own = [](int c) { return c; };
  EXPECT_TRUE(Found(own, 0).empty());
  EXPECT_TRUE(Found(own, 0, 0).empty());
  EXPECT_TRUE(Found(own, 3, 0).empty()) << "nobody can tell";
}

TEST_F(ImageMaskTest, ImagesOfTwoCamerasAreExchanged) {
  const std::vector<Finding> found = Found([](int c) { return 1 - c; }, 0);
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].code, "DAT-IMAGE-MASK");
  EXPECT_EQ(found[0].severity, Finding::Severity::kError);
  EXPECT_NE(found[0].text.find("fit the masks of 00_01, not those of 00_00"), std::string::npos) << found[0].text;
  EXPECT_NE(found[1].text.find("fit the masks of 00_00, not those of 00_01"), std::string::npos) << found[1].text;
}

TEST_F(ImageMaskTest, ImagesAreLate) {
  for (const int late : {3, -2}) {
    const std::vector<Finding> found = Found([](int c) { return c; }, late);
    ASSERT_EQ(found.size(), 2u);
    const std::string want = late > 0 ? "masks of 3 frames earlier" : "masks of 2 frames later";
    EXPECT_NE(found[0].text.find(want), std::string::npos) << found[0].text;
  }
}

TEST_F(VerifyTest, CalibrationInMetresSeesNobody) {
  EditJson(Path("calibration_t.json"), [](json& c) {
    for (json& camera : c["cameras"]) {
      for (json& row : camera["t"]) {
        json& value = row.is_array() ? row[0] : row;
        value = value.get<double>() / 100;
      }
    }
  });
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_GE(report.num_errors(), 1);
  const auto units = std::find_if(report.findings.begin(), report.findings.end(), [](const Finding& f) {
    return f.code == "DAT-UNITS" && f.severity == Finding::Severity::kError;
  });
  ASSERT_NE(units, report.findings.end());
  EXPECT_NE(units->text.find("Multiply each t by 100"), std::string::npos) << units->text;
}

TEST_F(VerifyTest, DuplicatedPerson) {
  EditJson(Scene(6), [](json& s) { s["bodies"].push_back(s["bodies"][0]); });
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.findings.at(0).code, "DAT-ID");
}

TEST_F(VerifyTest, BrokenPose) {
  EditJson(Scene(6), [](json& s) { s["bodies"][0]["joints19"][7] = "x"; });
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.findings.at(0).code, "DAT-POSE");
  EXPECT_NE(report.findings.at(0).text.find("joints19[7]"), std::string::npos);
}

TEST_F(VerifyTest, ANumberThatIsMissingIsToldAndCostsOneJoint) {
  EditJson(Scene(6), [](json& s) { s["bodies"][0]["joints19"][7] = nullptr; });
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.num_errors(), 0);
  EXPECT_EQ(report.findings.at(0).code, "DAT-JOINT");
  EXPECT_NE(report.findings.at(0).text.find("in 1 of the joints"), std::string::npos) << report.findings.at(0).text;
}

TEST_F(VerifyTest, TimeThatGoesBack) {
  EditJson(Scene(6), [](json& s) { s["univTime"] = 1.0; });
  EXPECT_EQ(Only("DAT-TIME"), 1);
}

TEST_F(VerifyTest, MissingFrame) {
  fs::remove(Scene(6));
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.num_errors(), 0);
  EXPECT_EQ(report.findings.at(0).code, "DAT-GAP");
}

TEST_F(VerifyTest, MetresInsteadOfCentimetres) {
  for (int frame = 5; frame < 8; ++frame) {
    EditJson(Scene(frame), [](json& s) {
      for (size_t i = 0; i < 76; ++i) {
        if (i % 4 != 3) s["bodies"][0]["joints19"][i] = s["bodies"][0]["joints19"][i].get<double>() / 100;
      }
    });
  }
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.findings.at(0).code, "DAT-UNITS");
}

TEST_F(VerifyTest, StrangeNames) {
  WriteFileAtomic(Path("hdImgs/00_00/thumbs.db"), "x");
  EXPECT_EQ(Only("DAT-NAME"), 1);
  fs::remove(Path("hdImgs/00_00/thumbs.db"));
  fs::rename(Path("hdImgs/00_01"), Path("hdImgs/00_07"));
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_GE(report.num_errors(), 1);
}

TEST_F(VerifyTest, SameVideoTwice) {
  for (int frame = 5; frame < 8; ++frame) {
    const std::string other = Path("hdImgs/00_01/00_01_0000000" + std::to_string(frame) + ".jpg");
    WriteImage(ReadImage(Image0(frame)), other, 70);  // encoded again
  }
  EXPECT_EQ(Only("DAT-DOUBLE"), 1);
}

TEST_F(VerifyTest, OneCameraHasMoreFrames) {
  fs::copy_file(Image0(7), Image0(8));
  std::set<std::string> codes;
  for (const Finding& f : VerifyDataset(folder_.path()).findings) codes.insert(f.code);
  EXPECT_EQ(codes, (std::set<std::string>{"DAT-POSE-MISSING", "DAT-COUNT"}));
}

TEST_F(VerifyTest, LinkOutOfTheFolder) {
  mvstudio::testing::TempDir elsewhere;
  fs::rename(Path("hdImgs/00_01"), elsewhere / "00_01");
  fs::create_directory_symlink(elsewhere / "00_01", Path("hdImgs/00_01"));
  const VerifyReport report = VerifyDataset(folder_.path());
  EXPECT_EQ(report.findings.at(0).code, "DAT-LINK");
  EXPECT_EQ(report.cameras, 1);
  VerifyOptions options;
  options.follow_links = true;
  const VerifyReport followed = VerifyDataset(folder_.path(), options);
  EXPECT_EQ(followed.num_errors(), 0);
  EXPECT_EQ(followed.cameras, 2);
}

TEST_F(VerifyTest, CalibrationRules) {
  const auto only = [&](const std::function<void(json&)>& change, const std::string& code, const std::string& part) {
    const std::string before = ReadFile(Path("calibration_t.json"));
    EditJson(Path("calibration_t.json"), change);
    const VerifyReport report = VerifyDataset(folder_.path());
    EXPECT_EQ(report.findings.size(), 1u) << part;
    EXPECT_EQ(report.findings.at(0).code, code);
    EXPECT_NE(report.findings.at(0).text.find(part), std::string::npos) << report.findings.at(0).text;
    WriteFileAtomic(Path("calibration_t.json"), before);
  };
  only([](json& c) { c["cameras"][1]["node"] = 5; }, "DAT-NAME", "panel and node do not agree");
  only([](json& c) { c["cameras"][1].erase("node"); }, "DAT-NAME", "panel or node is missing");
  only([](json& c) { c["cameras"][1]["type"] = "vga"; }, "DAT-CALIB", "cameras of panel 0 are 'hd'");
  only([](json& c) { c["cameras"][1].erase("type"); }, "DAT-CALIB", "type: is missing");
  only([](json& c) { c["cameras"][1]["distCoef"] = {-2.5, 0, 0, 0, 0}; }, "DAT-LENS", "folds over");
  only([](json& c) { c["cameras"][1]["t"] = c["cameras"][0]["t"]; }, "DAT-CALIB", "same place and direction");
}

TEST_F(VerifyTest, CamerasThatBearEachOthersNumbers) {
  EditJson(Path("calibration_t.json"), [](json& c) { c["cameras"][0]["node"] = 1, c["cameras"][1]["node"] = 0; });
  EXPECT_EQ(Only("DAT-NAME"), 2);
  EXPECT_EQ(VerifyDataset(folder_.path()).num_errors(), 2);
}

TEST_F(VerifyTest, ConfidencesAndRates) {
  EditJson(Scene(6), [](json& s) { s["bodies"][0]["joints19"][3] = 7; });
  EXPECT_EQ(Only("DAT-JOINT"), 1);
  EditJson(Scene(6), [](json& s) { s["bodies"][0]["joints19"][3] = 0.5, s["fpsType"] = "ntsc"; });
  EXPECT_EQ(Only("DAT-RATE"), 1);
}

TEST_F(VerifyTest, IrregularTimes) {
  EditJson(Scene(7), [](json& s) { s["univTime"] = 33.0 * 6 + 80; });
  EXPECT_EQ(Only("DAT-TIME"), 1);
}

TEST_F(VerifyTest, FacesAndHands) {
  const auto part = [](double x_cm, double y_cm, int count) {
    json xyz = json::array(), score = json::array();
    for (int i = 0; i < count; ++i) xyz.insert(xyz.end(), {x_cm, y_cm, 0.0}), score.push_back(0.5);
    return json({{"landmarks", xyz}, {"averageScore", score}});
  };
  const auto write = [&](const std::string& name, const json& people) {
    WriteFileAtomic(Path(name), json({{"people", people}}).dump());
  };
  const std::string face = "hdFace3d/faceRecon3D_hd00000005.json", hand = "hdHand3d/handRecon3D_hd00000005.json";
  const json good = {{"id", 0}, {"face70", part(-16, -145, 70)}};
  write(face, json::array({good}));
  write(hand, json::array({{{"id", 0}, {"right_hand", part(4, -95, 21)}}, {{"id", -1}}}));
  EXPECT_EQ(Only("none"), 0);
  write(face, json::array({good, good}));
  EXPECT_EQ(Only("DAT-FACE"), 1);
  write(face, json::array({{{"id", 0}, {"face70", part(-16, 145, 70)}}}));  // y up
  EXPECT_EQ(Only("DAT-FACE"), 1);
  write(face, json::array({{{"id", 3}, {"face70", part(-16, -145, 70)}}}));
  EXPECT_EQ(Only("DAT-FACE"), 1);
  write(face, json::array({good}));
  write(hand, json::array({json({{"id", 0}})}));
  EXPECT_EQ(Only("DAT-HAND"), 1);
  write(hand, json::array({{{"id", 0}, {"left_hand", part(0, 0, 70)}}}));
  EXPECT_EQ(Only("DAT-HAND"), 1);
}

TEST_F(VerifyTest, SyncTables) {
  const auto write = [&](double first, double step) {
    json times = json::array();
    for (int i = 0; i < 20; ++i) times.push_back(first + step * i);
    WriteFileAtomic(Path("synctables_t.json"), json({{"hd", {{"univ_time", times}}}}).dump());
  };
  write(-33, 33);  // frame f at f + 1
  EXPECT_EQ(Only("none"), 0);
  write(0, 33);
  EXPECT_EQ(Only("DAT-SYNC"), 1);
  EXPECT_EQ(VerifyDataset(folder_.path()).num_errors(), 0);  // another shift
  write(9, 33);
  EXPECT_EQ(VerifyDataset(folder_.path()).num_errors(), 1);
  write(500, -3);
  EXPECT_GE(Only("DAT-SYNC"), 1);
}

TEST_F(VerifyTest, Videos) {
  fs::remove_all(Path("hdImgs"));
  fs::remove_all(Path("masks"));
  const auto write = [&](int camera, int frames, int width) {
    fs::create_directories(Path("hdVideos"));
    VideoWriter writer(Path("hdVideos/hd_00_0" + std::to_string(camera) + ".mp4"), width, 60, 29.97);
    for (int f = 0; f < frames; ++f) writer.Write(SmoothImage(width, 60, 0.4 * f + 2 * camera));
    writer.Close();
  };
  write(0, 8, 80), write(1, 8, 80);
  EXPECT_EQ(Only("none"), 0);
  EXPECT_EQ(VerifyDataset(folder_.path()).videos, 2);
  write(1, 7, 80);
  std::multiset<std::string> codes;
  for (const Finding& f : VerifyDataset(folder_.path()).findings) codes.insert(f.code);
  EXPECT_EQ(codes, (std::multiset<std::string>{"DAT-COUNT", "DAT-IMAGE-MISSING"}));
  write(1, 8, 64);
  EXPECT_EQ(Only("DAT-SIZE"), 1);
  WriteFileAtomic(Path("hdVideos/hd_00_01.mp4"), "no video");
  EXPECT_EQ(Only("DAT-VIDEO"), 1);
}

TEST_F(VerifyTest, WhatRemainsUsable) {
  fs::remove_all(Path("hdImgs"));
  fs::remove_all(Path("masks"));
  EXPECT_EQ(Only("DAT-IMAGE"), 1);  // a warning: calibration and joints are a dataset
  EXPECT_EQ(VerifyDataset(folder_.path()).unusable, "");
  fs::remove_all(Path("hdPose3d_stage1_coco19"));
  EXPECT_NE(VerifyDataset(folder_.path()).unusable, "");
}

TEST_F(VerifyTest, NoDatasetAtAll) {
  EXPECT_THROW(VerifyDataset(Path("none")), IoError);
  EXPECT_THROW(VerifyDataset(Path("hdImgs")), IoError);
}

TEST_F(VerifyTest, WhatOthersCheckedIsNotLookedAtAgain) {
  WriteImage(Image(80, 60, 1), Mask0(6));  // the joints lie beside it
  fs::remove(Path("hdImgs/00_01/00_01_00000007.jpg"));
  const VerifyReport whole = VerifyDataset(folder_.path());
  ASSERT_FALSE(whole.findings.empty());
  std::map<std::string, std::string> bytes;
  KeptChecks kept;
  kept.load = [&](const std::string& camera) {
    const auto found = bytes.find(camera);
    return found == bytes.end() ? std::nullopt : std::optional<std::string>(found->second);
  };
  kept.store = [&](const std::string& camera, std::string made) { bytes[camera] = std::move(made); };
  kept.count = 2;
  for (kept.index = 0; kept.index < 2; ++kept.index) {
    VerifyDataset(folder_.path(), {}, {}, kept);
    EXPECT_EQ(bytes.size(), static_cast<size_t>(kept.index + 1)) << "one camera a share";
  }
  WriteFileAtomic(Image0(5), "damaged since");
  kept.count = 0;
  const VerifyReport joined = VerifyDataset(folder_.path(), {}, {}, kept);
  const auto texts = [](const VerifyReport& report) {
    std::vector<std::string> all;
    for (const Finding& finding : report.findings) all.push_back(finding.code + " " + finding.path + " " + finding.text);
    return all;
  };
  EXPECT_EQ(texts(joined), texts(whole)) << "the damage was not seen";
  EXPECT_EQ(joined.images, whole.images);
  EXPECT_EQ(joined.masks, whole.masks);
  EXPECT_EQ(joined.no_image, whole.no_image);
  bytes["00_00"].pop_back();
  EXPECT_GT(VerifyDataset(folder_.path(), {}, {}, kept).num_errors(), whole.num_errors()) << "damaged bytes are none";
}

}  // namespace
}  // namespace mvstudio::dataset
