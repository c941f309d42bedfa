#include "dataset/panoptic/panoptic_files.h"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "core/disk/paths.h"
#include "core/error.h"
#include "dataset/panoptic/panoptic.h"
#include "tests/dataset/dataset_test_util.h"
#include "tests/support/message_of.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using mvstudio::testing::MessageOf;
using nlohmann::json;

std::vector<std::string> RealScenes() {
  std::vector<std::string> paths;
  for (const char* band : {"160906_band1", "160906_band2"}) {
    for (const std::string& path : FilesMatching(DataFolder(std::string("panoptic/") + band + "/hdPose3d_stage1_coco19")))
      paths.push_back(path);
  }
  return paths;
}

std::string WithoutCarriageReturns(std::string text) {
  text.erase(std::remove(text.begin(), text.end(), '\r'), text.end());
  return text;
}

/// Any finite double: all exponents, both signs, denormal and negative zero.
double AnyDouble(Rng& rng) {
  while (true) {
    const uint64_t bits = rng.Next();
    double value = 0;
    std::memcpy(&value, &bits, sizeof value);
    if (rng.Index(20) == 0) return -0.0;
    if (rng.Index(20) == 0) return static_cast<double>(rng.Index(1000));
    if (std::isfinite(value)) return value;
  }
}

uint64_t Bits(double value) {
  uint64_t bits = 0;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}

void ExpectSameBits(const std::vector<double>& a, const std::vector<double>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) EXPECT_EQ(Bits(a[i]), Bits(b[i])) << a[i] << " became " << b[i];
}

std::vector<double> NumbersOf(const PanopticCamera& c) {
  std::vector<double> numbers(c.distortion.begin(), c.distortion.end());
  numbers.insert(numbers.end(), c.K.data(), c.K.data() + 9);
  numbers.insert(numbers.end(), c.cam_from_world_rotation.data(), c.cam_from_world_rotation.data() + 9);
  numbers.insert(numbers.end(), c.cam_from_world_translation_cm.data(), c.cam_from_world_translation_cm.data() + 3);
  return numbers;
}

const char kCalibration[] =
    R"({"calibDataSource":"s","made":{"by":[1,"x"]},"cameras":[{"name":"00_03","type":"hd","resolution":[8,6],"panel":0,"node":3,)"
    R"("K":[[9,0,4],[0,9.5,3],[0,0,1]],"distCoef":[0.1,0,0,0,-0],"R":[[1,0,0],[0,1,0],[0,0,1]],"t":[[1],[-2.5],[300]],"serial":"A7"}]})";
const char kScene[] =
    R"({"version":0.7,"univTime":12.5,"fpsType":"vga_25","vgaVideoTime":40,"note":null,"bodies":[{"id":-1,"joints15":[],"tag":true}]})";
const char kSync[] =
    R"({"hd":{"univ_time":[-1,10.5,43.8],"index":[0,1,2]},"kinect":{"color":{"KINECTNODE1":{"univ_time":[7]}},"n":10}})";

std::string SceneText() {
  std::string joints;
  for (int i = 0; i < 60; ++i) joints += (i ? "," : "") + std::to_string(i % 4 == 3 ? 1 : i);
  std::string text = kScene;
  return text.replace(text.find("[]"), 2, "[" + joints + "]");
}

std::string LandmarksText(int points, const std::string& key) {
  std::string xyz, n, lists;
  for (int i = 0; i < 3 * points; ++i) xyz += (i ? "," : "") + std::to_string(0.5 * i);
  for (int i = 0; i < points; ++i) n += (i ? "," : "") + std::to_string(0.25 * i), lists += i ? ",[3,1]" : "[]";
  return R"({"frame":4,"people":[{"id":2,")" + key + R"(":{"landmarks":[)" + xyz + R"(],"averageScore":[)" + n +
         R"(],"averageReproError":[)" + n + R"(],"visibility":[)" + lists + R"(],"x":1},"sex":"f"}]})";
}

TEST(PanopticFiles, RealCalibrationsComeBackByteForByte) {
  MVS_NEEDS_DATA("panoptic");
  mvstudio::testing::TempDir folder;
  for (const std::string band : {"160906_band1", "160906_band2"}) {
    const std::string path = DataFolder("panoptic/" + band + "/calibration_" + band + ".json");
    const PanopticCalibrationFile once = ReadPanopticCalibrationFile(path);
    WritePanopticCalibrationFile(once, folder / "copy.json");
    EXPECT_EQ(ReadFile(path), ReadFile(folder / "copy.json"));
    EXPECT_EQ(json::parse(ReadFile(path)), json::parse(ReadFile(folder / "copy.json")));
    const PanopticCalibrationFile twice = ReadPanopticCalibrationFile(folder / "copy.json");
    ASSERT_EQ(once.cameras.size(), 520u);
    ASSERT_EQ(twice.cameras.size(), 520u);
    std::map<std::string, int> types;
    for (size_t i = 0; i < 520; ++i) {
      ExpectSameBits(NumbersOf(once.cameras[i]), NumbersOf(twice.cameras[i]));
      ++types[*once.cameras[i].type];
    }
    EXPECT_EQ(types, (std::map<std::string, int>{{"hd", 31}, {"kinect-color", 10}, {"vga", 479}}));
  }
}

TEST(PanopticFiles, RealScenesComeBackByteForByte) {
  MVS_NEEDS_DATA("panoptic");
  const auto paths = RealScenes();
  ASSERT_EQ(paths.size(), 40u);
  mvstudio::testing::TempDir folder;
  for (const std::string& path : paths) {
    const PanopticScene once = ReadPanopticScene(path);
    WritePanopticScene(once, folder / "copy.json");
    EXPECT_EQ(WithoutCarriageReturns(ReadFile(path)), ReadFile(folder / "copy.json")) << path;
    const PanopticScene twice = ReadPanopticScene(folder / "copy.json");
    ASSERT_EQ(once.bodies.size(), twice.bodies.size());
    for (size_t b = 0; b < once.bodies.size(); ++b) ExpectSameBits(once.bodies[b].joints19, twice.bodies[b].joints19);
    // and through our own world, where a joint that is not there has no place (here and there CMU's files keep its last one)
    PanopticScene plain = once;
    for (PanopticBody& body : plain.bodies) {
      for (size_t j = 0; j < 76; j += 4) {
        if (body.joints19[j + 3] < 0) std::fill_n(body.joints19.begin() + static_cast<std::ptrdiff_t>(j), 3, 0.0);
      }
    }
    WriteBody3dScene(ReadBody3dScene(path), *once.univ_time_ms, folder / "ours.json");
    EXPECT_EQ(ToText(plain), ReadFile(folder / "ours.json")) << path;
  }
}

TEST(PanopticFiles, AnyDoubleSurvives) {
  Rng rng(11);
  for (int round = 0; round < 200; ++round) {
    PanopticCalibrationFile file;
    file.cameras.resize(1);
    PanopticCamera& camera = file.cameras[0];
    camera.name = "00_00", camera.width_px = 640, camera.height_px = 480;
    for (double& v : camera.distortion) v = AnyDouble(rng);
    for (int i = 0; i < 9; ++i) camera.K(i) = AnyDouble(rng), camera.cam_from_world_rotation(i) = AnyDouble(rng);
    for (int i = 0; i < 3; ++i) camera.cam_from_world_translation_cm[i] = AnyDouble(rng);
    ExpectSameBits(NumbersOf(camera), NumbersOf(ParsePanopticCalibration(ToText(file), "c.json").cameras.at(0)));
    PanopticScene scene;
    scene.univ_time_ms = AnyDouble(rng), scene.vga_video_time_ms = AnyDouble(rng);
    scene.bodies.resize(1);
    for (int i = 0; i < 76; ++i) scene.bodies[0].joints19.push_back(AnyDouble(rng));
    const PanopticScene back = ParsePanopticScene(ToText(scene), "s.json");
    ExpectSameBits(scene.bodies[0].joints19, back.bodies.at(0).joints19);
    ExpectSameBits({*scene.univ_time_ms, *scene.vga_video_time_ms}, {*back.univ_time_ms, *back.vga_video_time_ms});
  }
}

/// A metre is not always the hundredth of a double: the first trip may cost half a unit in the last place, further ones
/// nothing.
TEST(PanopticFiles, MetresSurviveTheTripThroughCentimetres) {
  Rng rng(12);
  mvstudio::testing::TempDir folder;
  const auto trip = [&](const Coco19Pose& pose) {
    WriteBody3dScene({{5, pose}}, 1, folder / "a.json");
    return ReadBody3dScene(folder / "a.json").at(5);
  };
  for (int round = 0; round < 30; ++round) {
    Coco19Pose pose = StandingPerson(0);
    for (int j = 0; j < 19; ++j) {
      pose.x_in_world.col(j) = Eigen::Vector3d(rng.Normal(), rng.Normal(), rng.Normal()) * std::pow(10, rng.Uniform(-6, 4));
      pose.confidence[j] = rng.Uniform(0, 1);
    }
    const Coco19Pose once = trip(pose), twice = trip(once);
    EXPECT_LE(((once.x_in_world - pose.x_in_world).array().abs() / pose.x_in_world.array().abs()).maxCoeff(), 2.3e-16);
    EXPECT_EQ(once.confidence, pose.confidence);
    EXPECT_EQ(twice.x_in_world, once.x_in_world);
  }
}

TEST(PanopticFiles, UnknownKeysAndAbsentOnesStayAsTheyAre) {
  const auto same = [](const std::string& before, const std::string& after) {
    EXPECT_EQ(json::parse(before), json::parse(after));
  };
  same(kCalibration, ToText(ParsePanopticCalibration(kCalibration, "c")));
  same(SceneText(), ToText(ParsePanopticScene(SceneText(), "s")));
  same(R"({"bodies":[]})", ToText(ParsePanopticScene(R"({"bodies":[]})", "s")));
  same(LandmarksText(70, "face70"), ToText(ParsePanopticLandmarks(LandmarksText(70, "face70"), "f")));
  same(LandmarksText(21, "left_hand"), ToText(ParsePanopticLandmarks(LandmarksText(21, "left_hand"), "h")));
  same(kSync, ToText(ParsePanopticSyncTables(kSync, "t")));
  const std::string bare = R"({"cameras":[{"name":"00_03","resolution":[8,6],"K":[[9,0,4],[0,9,3],[0,0,1]],)"
                           R"("distCoef":[0,0,0,0,0],"R":[[1,0,0],[0,1,0],[0,0,1]],"t":[1,2,3]}]})";
  EXPECT_FALSE(json::parse(ToText(ParsePanopticCalibration(bare, "c")))["cameras"][0].contains("panel"));
}

TEST(PanopticFiles, BodiesOfEverySkeletonAndFalsePositives) {
  const PanopticScene scene = ParsePanopticScene(SceneText(), "s");
  EXPECT_EQ(scene.bodies.at(0).id, -1);
  EXPECT_EQ(scene.bodies.at(0).joints15.size(), 60u);
  EXPECT_EQ(*scene.vga_video_time_ms, 40);
  EXPECT_TRUE(ToCoco19(scene, "s").empty());  // an id below 0 is nobody
  PanopticScene legacy = scene;
  legacy.bodies[0].id = 0;
  EXPECT_NE(MessageOf<FormatError>([&] { ToCoco19(legacy, "s.json"); }).find("another skeleton"), std::string::npos);
  PanopticScene gaps = ToPanopticScene({{3, StandingPerson(0)}, {7, StandingPerson(1)}}, 5);
  EXPECT_EQ(ToCoco19(gaps, "s").count(7), 1u);
  gaps.bodies[1].id = 3;
  EXPECT_EQ(MessageOf<FormatError>([&] { ToCoco19(gaps, "s.json"); }), "s.json: bodies[1].id: 3 is there twice");
}

TEST(PanopticFiles, FacesAndHands) {
  const PanopticLandmarkFile face = ParsePanopticLandmarks(LandmarksText(70, "face70"), "f");
  ASSERT_TRUE(face.people.at(0).face70);
  EXPECT_NEAR(MeanScore(*face.people[0].face70), 0.25 * 34.5, 1e-12);
  const Eigen::Matrix3Xd points = InWorld(*face.people[0].face70);
  EXPECT_EQ(points.cols(), 70);
  EXPECT_EQ(points.col(1), Eigen::Vector3d(1.5 / 100, 2.5 / 100, -2.0 / 100));  // (1.5, 2, 2.5) cm, y down
  EXPECT_EQ((*face.people[0].face70->visibility)[1], (std::vector<int>{3, 1}));
  const PanopticLandmarkFile hand = ParsePanopticLandmarks(LandmarksText(21, "right_hand"), "h");
  EXPECT_FALSE(hand.people.at(0).left_hand);
  EXPECT_TRUE(hand.people.at(0).right_hand);
  EXPECT_NE(MessageOf<FormatError>([] {
              ParsePanopticLandmarks(LandmarksText(21, "face70"), "f");
            }).find("people[0].face70.landmarks"),
            std::string::npos);
}

TEST(PanopticFiles, SyncTables) {
  const PanopticSyncTables tables = ParsePanopticSyncTables(kSync, "t");
  ASSERT_NE(tables.Find("hd"), nullptr);
  EXPECT_EQ(tables.Find("hd")->univ_time_ms, (std::vector<double>{-1, 10.5, 43.8}));
  ASSERT_NE(tables.Find("kinect.color.KINECTNODE1"), nullptr);
  EXPECT_FALSE(tables.Find("kinect.color.KINECTNODE1")->index);
  EXPECT_EQ(tables.Find("kinect.depth.KINECTNODE1"), nullptr);
  EXPECT_EQ(MessageOf<FormatError>([] { ParsePanopticSyncTables(R"({"hd":{"univ_time":[1,2],"index":[1]}})", "t.json"); }),
            "t.json: hd.index: must be as long as univ_time (2), has 1");
}

/// The four readers, by what they are given.
struct Reader {
  const char* name;
  std::string good;
  std::function<void(const std::string&)> parse;
};
std::vector<Reader> Readers() {
  return {{"calibration", kCalibration, [](const std::string& t) { ParsePanopticCalibration(t, "f.json"); }},
          {"scene", SceneText(), [](const std::string& t) { ParsePanopticScene(t, "f.json"); }},
          {"landmarks", LandmarksText(21, "left_hand"), [](const std::string& t) { ParsePanopticLandmarks(t, "f.json"); }},
          {"sync", kSync, [](const std::string& t) { ParsePanopticSyncTables(t, "f.json"); }}};
}

TEST(PanopticFilesHostile, CutAtEveryByte) {
  for (const Reader& reader : Readers()) {
    reader.parse(reader.good);
    for (size_t size = 0; size < reader.good.size(); ++size)
      EXPECT_THROW(reader.parse(reader.good.substr(0, size)), FormatError) << reader.name << " " << size;
  }
}

TEST(PanopticFilesHostile, DepthDuplicatesAndNumbersBeyondDoubles) {
  for (const Reader& reader : Readers()) {
    const auto message = [&](const std::string& text) { return MessageOf<FormatError>([&] { reader.parse(text); }); };
    EXPECT_EQ(message(std::string(100000, '[')), "f.json: is nested deeper than 64 levels");
    std::string deep;
    for (int i = 0; i < 100000; ++i) deep += "{\"a\":";
    EXPECT_EQ(message(deep), "f.json: is nested deeper than 64 levels");
    EXPECT_EQ(message(R"({"a":{"b":[0,{"c":1,"c":2}]}})"), "f.json: a.b[1]: the key 'c' is there twice");
    EXPECT_EQ(message(R"({"a":1e400})"), "f.json: byte 10: the number is beyond the range of doubles");
    // Joints may lack a number; every other one is needed.
    EXPECT_TRUE(message(R"({"a":-Infinity})") == "f.json: a: is -Infinity, which is no number: every number is needed here" ||
                message(R"({"a":-Infinity})") == "f.json: bodies: is missing");
    for (const char* bad : {"{\"a\":\"\xff\xfe\"}", "{\"a\":\"\xc3\"}", "{'a':1}", "{\"a\":01}", "", "\xff\xfe{\0}\0",
                            "{\"a\":1}{", "// x\n{}"}) {
      EXPECT_NE(message(bad).find("f.json: byte "), std::string::npos) << bad;
    }
    EXPECT_NE(message("[]").find("f.json: must be an object"), std::string::npos);
    EXPECT_NE(message("3").find("f.json: must be an object"), std::string::npos);
    std::string keys = "{";  // many keys take no quadratic time
    for (int i = 0; i < 200000; ++i) keys += "\"k" + std::to_string(i) + "\":0,";
    EXPECT_EQ(message(keys + "\"k7\":0}"), "f.json: the key 'k7' is there twice");
    reader.parse("\xef\xbb\xbf" + reader.good);  // a byte order mark is no reason to refuse
  }
}

/// Every value in turn becomes something else: an error with the path, or a file that is read and written all the same.
TEST(PanopticFilesHostile, EveryValueReplaced) {
  const json strange[] = {nullptr,
                          true,
                          "x",
                          "../../etc",
                          1e300,
                          -1e300,
                          4294967296.0,
                          -3,
                          0.5,
                          json::array(),
                          json::object(),
                          json::array({json::array()}),
                          std::string(5000, 'x'),
                          "a\nb\x1b[31m"};
  for (const Reader& reader : Readers()) {
    const json good = json::parse(reader.good).flatten();
    for (const auto& [place, value] : good.items()) {
      for (const json& other : strange) {
        json bad = json::parse(reader.good);
        bad[json::json_pointer(place)] = other;
        try {
          reader.parse(bad.dump());
        } catch (const FormatError& error) {
          EXPECT_EQ(error.path(), "f.json");
          EXPECT_LT(std::string(error.what()).size(), 300u);
          EXPECT_EQ(std::string(error.what()).find_first_of("\n\x1b"), std::string::npos);
        }
      }
    }
  }
}

/// CMU's programs know a camera by panel and node, its footage by the name.
TEST(PanopticFiles, ANameAgainstPanelAndNode) {
  const auto numbered = [](std::initializer_list<json> nodes) {
    json file = json::parse(kCalibration);
    const json first = file["cameras"][0];
    file["cameras"] = json::array();
    for (const json& node : nodes) {
      json camera = first;
      camera["name"] = "00_0" + std::to_string(file["cameras"].size()), camera["node"] = node;
      if (node.is_null()) camera.erase("node");
      file["cameras"].push_back(camera);
    }
    return ParsePanopticCalibration(file.dump(), "c.json");
  };
  EXPECT_TRUE(PanopticNameConflicts(numbered({0, 1, nullptr}).cameras).empty());
  for (const PanopticCalibrationFile& file : {numbered({1, 0, 2}), numbered({1, 2, 3})}) {  // exchanged; counted from 1
    EXPECT_TRUE(PanopticNameConflicts(file.cameras).at(0).exchanged);
    const std::string why = MessageOf<FormatError>([&] { ToRig(file, "c.json"); });
    EXPECT_NE(why.find("cameras[0]"), std::string::npos) << why;
    EXPECT_NE(why.find("the name '00_00': they say 00_01, which is another camera"), std::string::npos) << why;
  }
  for (const PanopticCalibrationFile& file : {numbered({0, 0, 0}), numbered({0, 7, 2})}) {  // nobody's number; another one
    const auto conflicts = PanopticNameConflicts(file.cameras);
    ASSERT_FALSE(conflicts.empty());
    EXPECT_EQ(conflicts[0].camera, 1u);
    EXPECT_NE(conflicts[0].text.find("the name counts"), std::string::npos);
    EXPECT_EQ(ToRig(file, "c.json").cameras.at(1).camera.name, "00_01");
  }
}

TEST(PanopticFilesHostile, WhatACalibrationMustNotHold) {
  mvstudio::testing::TempDir folder;
  const auto where = [&](const std::function<void(json&)>& change) {
    json bad = json::parse(kCalibration);
    change(bad["cameras"][0]);
    const std::string text = bad.dump();
    try {
      ToRig(ParsePanopticCalibration(text, "c.json"), "c.json");
    } catch (const FormatError& error) {
      return error.where();
    }
    return std::string("no error");
  };
  EXPECT_EQ(where([](json&) {}), "no error");
  for (const char* name : {"../up", "a/b", "", ".", "..", "a\\b", "a\nb"}) {
    EXPECT_EQ(where([&](json& c) { c["name"] = name; }), "cameras[0].name") << name;
  }
  EXPECT_EQ(where([](json& c) { c["panel"] = 3000000000.0; }), "cameras[0].panel");
  EXPECT_EQ(where([](json& c) { c["node"] = 0.5; }), "cameras[0].node");
  EXPECT_EQ(where([](json& c) { c["resolution"] = {2147483647, 2}; }), "cameras[0].resolution");
  EXPECT_EQ(where([](json& c) { c["K"][0][0] = -1; }), "cameras[0].K");
  EXPECT_EQ(where([](json& c) { c["K"][0].push_back(1); }), "cameras[0].K[0]");
  EXPECT_EQ(where([](json& c) { c["R"] = json::array({{1e200, 0, 0}, {0, 1e200, 0}, {0, 0, 1e200}}); }), "cameras[0].R");
  EXPECT_EQ(where([](json& c) { c["t"][1] = {1, 2}; }), "cameras[0].t[1]");
  EXPECT_EQ(where([](json& c) {
              c["distCoef"] = json::array();
              for (int i = 0; i < 100000; ++i) c["distCoef"].push_back(0);
            }),
            "cameras[0].distCoef");
}

TEST(PanopticFilesHostile, WhatIsNoPlainFileOrTooLarge) {
  mvstudio::testing::TempDir folder;
  EXPECT_THROW(ReadPanopticScene(folder / "none.json"), IoError);
  EXPECT_THROW(ReadPanopticScene(folder.path()), IoError);
  fs::create_symlink("/dev/zero", folder / "endless.json");
  EXPECT_THROW(ReadPanopticScene(folder / "endless.json"), IoError);
  WriteFileAtomic(folder / "big.json", "{");
  fs::resize_file(folder / "big.json", uintmax_t{1} << 40);  // sparse
  EXPECT_THROW(ReadPanopticScene(folder / "big.json"), FormatError);
  EXPECT_THROW(ReadPanopticCalibrationFile(folder / "big.json"), FormatError);
}

}  // namespace
}  // namespace mvstudio::dataset
