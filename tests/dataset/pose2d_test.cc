#include "dataset/pose/pose2d.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "core/random.h"
#include "tests/support/message_of.h"

namespace mvstudio::dataset {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

class Pose2d : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    folder_ = fs::temp_directory_path() / ("mvstudio_pose2d_" + std::to_string(getpid()) + "_" + info->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  void Put(const std::string& name, const std::string& content) const { std::ofstream(folder_ / name) << content; }
  Pose2dTrack Read(const char* skeleton = "coco17") const {
    return ReadOpenPoseFolder(folder_.string(), "cam_03", geometry::SkeletonByName(skeleton));
  }
  template <class E>
  std::string MessageOf(const char* skeleton = "coco17") const {
    try {
      Read(skeleton);
    } catch (const E& error) {
      return error.what();
    }
    return "no such exception";
  }
  static std::string People(size_t num_numbers) {
    std::string text = "{\"version\":1.3,\"people\":[{\"pose_keypoints_2d\":[";
    for (size_t i = 0; i < num_numbers; ++i) text += (i ? "," : "") + std::to_string(i) + ".5";
    return text + "]}]}";
  }
  fs::path folder_;
};

Pose2dTrack RandomTrack(uint64_t seed) {
  Rng rng(seed);
  Pose2dTrack track{"cam_03", {}};
  for (const int frame : {0, 7, 123456}) {
    auto& people = track.frames[frame];
    people.resize(static_cast<size_t>(rng.Index(3)));
    for (Person2d& person : people) {
      for (int k = 0; k < 25; ++k) person.keypoints.push_back({rng.Uniform(-5, 2000), rng.Uniform(-5, 2000), rng.Uniform()});
    }
  }
  return track;
}

TEST_F(Pose2d, RoundTripIsExact) {
  for (uint64_t seed = 1; seed <= 5; ++seed) {
    fs::remove_all(folder_);
    const Pose2dTrack track = RandomTrack(seed);
    WriteOpenPoseFolder(track, folder_.string());
    const Pose2dTrack read = Read("body25");
    ASSERT_EQ(read.frames.size(), track.frames.size());
    for (const auto& [frame, people] : track.frames) {
      ASSERT_EQ(read.frames.at(frame).size(), people.size());
      for (size_t p = 0; p < people.size(); ++p) {
        for (size_t k = 0; k < 25; ++k) {
          EXPECT_EQ(read.frames.at(frame)[p].keypoints[k].x_px, people[p].keypoints[k].x_px);
          EXPECT_EQ(read.frames.at(frame)[p].keypoints[k].y_px, people[p].keypoints[k].y_px);
          EXPECT_EQ(read.frames.at(frame)[p].keypoints[k].score, people[p].keypoints[k].score);
        }
      }
    }
  }
}

TEST_F(Pose2d, FrameNumbersOfAllNamings) {
  const std::string empty = "{\"people\":[]}";
  Put("cam01.0004.json", empty);
  Put("00000012_keypoints.json", empty);
  Put("take2_000000000099_keypoints.json", empty);
  Put("00_03_00000100.json", empty);
  Put("notes.txt", "not a key-point file");
  const Pose2dTrack track = Read();
  std::vector<int> frames;
  for (const auto& [frame, people] : track.frames) {
    frames.push_back(frame);
    EXPECT_TRUE(people.empty());
  }
  EXPECT_THAT(frames, ::testing::ElementsAre(4, 12, 99, 100));
}

/// OpenPose ends the names of its second camera's files with _1.
TEST_F(Pose2d, TheNumberOfACameraIsNoFrame) {
  for (const char* frame : {"000000000003", "000000000004", "000000000017"})
    Put(frame + std::string("_1_keypoints.json"), "{\"people\":[]}");
  std::vector<int> frames;
  for (const auto& [frame, people] : Read().frames) frames.push_back(frame);
  EXPECT_THAT(frames, ::testing::ElementsAre(3, 4, 17));
}

TEST_F(Pose2d, ListsAndPeopleOfOtherPrograms) {
  const std::string people = People(51), first = "{\"people\":[{\"pose_keypoints\"" + people.substr(people.find(":[", 30));
  Put("1.json", first);  // OpenPose before 1.2
  const std::string numbers = people.substr(people.find(":[", 30) + 1, people.rfind("}]}") - people.find(":[", 30) - 1);
  Put("000002.jpg.predictions.json", "[{\"keypoints\":" + numbers + ",\"score\":0.9}]");  // OpenPifPaf
  std::string points, scores;
  for (int k = 0; k < 17; ++k) {
    points += (k ? ",[" : "[") + std::to_string(3 * k) + ".5," + std::to_string(3 * k + 1) + ".5]";
    scores += (k ? "," : "") + std::to_string(3 * k + 2) + ".5";
  }
  const std::string instances = "[{\"keypoints\":[" + points + "],\"keypoint_scores\":[" + scores + "]}]";
  Put("3.json", instances);                                // MMPose, an image
  Put("4.json", "{\"instance_info\":" + instances + "}");  // the same, Sapiens
  std::string triples, x, y, seen;
  for (int k = 0; k < 17; ++k) {
    const std::string at[] = {std::to_string(3 * k) + ".5", std::to_string(3 * k + 1) + ".5"};
    triples += (k ? ",[" : "[") + at[0] + "," + at[1] + ",0.5]";
    x += (k ? "," : "") + at[0], y += (k ? "," : "") + at[1], seen += k ? ",0.5" : "0.5";
  }
  Put("6.json", "{\"height\":9,\"annots\":[{\"personID\":0,\"keypoints\":[" + triples + "]}]}");  // EasyMocap
  Put("7.json",
      "[{\"name\":\"person\",\"keypoints\":{\"x\":[" + x + "],\"y\":[" + y + "],\"visible\":[" + seen + "]}}]");  // Ultralytics
  const Pose2dTrack track = Read();
  EXPECT_TRUE(track.skipped.empty()) << track.skipped[0];
  for (const int frame : {1, 2, 3, 4, 6, 7}) {
    ASSERT_EQ(track.frames.at(frame).size(), 1u) << frame;
    EXPECT_EQ(track.frames.at(frame)[0].keypoints[16].y_px, 49.5) << frame;
  }
  Put("5.json", "{\"people\":[{\"joints\":[1,2,3]}]}");
  EXPECT_THAT(Read().skipped, ::testing::ElementsAre(HasSubstr("has no list pose_keypoints_2d")));
}

TEST_F(Pose2d, EmptyAndMissingFolders) {
  EXPECT_THAT(MessageOf<IoError>(), AllOf(HasSubstr(folder_.string()), HasSubstr("cam_03"), HasSubstr("no .json")));
  fs::remove_all(folder_);
  EXPECT_THAT(MessageOf<IoError>(),
              AllOf(HasSubstr(folder_.string()), HasSubstr("cam_03"), HasSubstr("no such file or folder")));
}

TEST_F(Pose2d, TruncatedJsonNamesFileCameraAndFrame) {
  const std::string whole = People(51);
  for (size_t size = 0; size < whole.size(); size += 7) {
    Put("f_0042_keypoints.json", whole.substr(0, size));
    EXPECT_THAT(MessageOf<FormatError>(),
                AllOf(HasSubstr("f_0042_keypoints.json"), HasSubstr("cam_03"), HasSubstr("frame 42"), HasSubstr("truncated")))
        << size;
  }
}

TEST_F(Pose2d, DamagedContentIsRefused) {
  Put("1.json", "{\"people\": [ } ");
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("damaged"));
  Put("1.json", "[1, 2]");
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("[0]: is not an object"));
  Put("1.json", "{\"people\":[{\"pose_keypoints_2d\":\"x\"}]}");
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("people[0].pose_keypoints_2d"));
  Put("1.json", "{\"people\":[{\"pose_keypoints_2d\":[1e999]}]}");
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("1.json"));
  std::string with_text = People(51);
  with_text.replace(with_text.find("4.5"), 3, "\"x\"");
  Put("1.json", with_text);
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("pose_keypoints_2d[4]"));
  Put("1.json", std::string(100000, '['));
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("nested deeper"));
}

TEST_F(Pose2d, AMissingValueCostsItsKeypointAlone) {
  for (const std::string word : {"NaN", "null", "Infinity", "-Infinity"}) {
    std::string text = People(51);
    text.replace(text.find("4.5"), 3, word);  // y of the second keypoint
    Put("000001_keypoints.json", text.insert(text.find("\"people\""), "\"note\":\"NaN \\\" -Infinity\","));
    const Pose2dTrack track = Read();
    EXPECT_TRUE(track.skipped.empty()) << track.skipped[0];
    const std::vector<Keypoint2d>& keypoints = track.frames.at(1).at(0).keypoints;
    EXPECT_EQ(keypoints.at(0).y_px, 1.5);
    EXPECT_EQ(keypoints.at(1).score, 0) << word;
    EXPECT_EQ(keypoints.at(2).x_px, 6.5) << word;
  }
  Put("000001_keypoints.json", "{\"people\":[NaN,NaN,}");  // byte 20 of the file
  EXPECT_NE(MessageOf<FormatError>().find("at byte 20 of 20"), std::string::npos) << MessageOf<FormatError>();
}

TEST_F(Pose2d, OneDamagedFileAmongManyIsLeftOutAndListed) {
  for (int f = 0; f < 100; ++f) Put("f_" + std::to_string(1000 + f) + "_keypoints.json", People(51));
  Put("f_1042_keypoints.json", People(51).substr(0, 80));
  Put("f_1043_keypoints.json", "");
  Put("f_1044_keypoints.json", People(75));
  const Pose2dTrack track = Read();
  EXPECT_EQ(track.frames.size(), 97u);
  EXPECT_EQ(track.frames.count(1042), 0u);
  EXPECT_THAT(track.skipped, ::testing::ElementsAre(AllOf(HasSubstr("f_1042"), HasSubstr("frame 1042"), HasSubstr("truncated")),
                                                    HasSubstr("f_1043"), AllOf(HasSubstr("f_1044"), HasSubstr("body25"))));
}

TEST_F(Pose2d, MostlyDamagedFilesAreAnError) {
  for (int f = 0; f < 10; ++f) Put("f_" + std::to_string(f) + ".json", f < 4 ? People(51) : People(54));
  EXPECT_THAT(MessageOf<FormatError>(), AllOf(HasSubstr("frame 4"), HasSubstr("coco18")));
}

TEST_F(Pose2d, FiftyPeopleAndNone) {
  std::string text = "{\"people\":[";
  const std::string one = People(51);
  const size_t begin = one.find("{\"pose"), end = one.rfind("]}");
  for (int p = 0; p < 50; ++p) text += (p ? "," : "") + one.substr(begin, end - begin);
  Put("1.json", text + "]}");
  Put("2.json", "{\"people\":[]}");
  const Pose2dTrack track = Read();
  EXPECT_EQ(track.frames.at(1).size(), 50u);
  EXPECT_EQ(track.frames.at(2).size(), 0u);
}

TEST_F(Pose2d, FaceAndHandsRoundTrip) {
  Rng rng(3);
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("openpose137");
  Pose2dTrack track{"cam_03", {}};
  for (int k = 0; k < 137; ++k) {
    if (k == 0) track.frames[5].emplace_back();
    track.frames[5][0].keypoints.push_back({rng.Uniform(0, 2000), rng.Uniform(0, 2000), rng.Uniform()});
  }
  WriteOpenPoseFolder(track, folder_.string(), &skeleton);
  const auto expect_same = [&](const Pose2dTrack& read, size_t first, size_t count) {
    for (size_t k = 0; k < count; ++k) {
      EXPECT_EQ(read.frames.at(5)[0].keypoints[k].x_px, track.frames[5][0].keypoints[first + k].x_px);
      EXPECT_EQ(read.frames.at(5)[0].keypoints[k].score, track.frames[5][0].keypoints[first + k].score);
    }
  };
  expect_same(Read("openpose137"), 0, 137);
  expect_same(Read("body25"), 0, 25);
  expect_same(Read("body25+face"), 0, 95);
  const Pose2dTrack hands = Read("body25+hands");
  ASSERT_EQ(hands.frames.at(5)[0].keypoints.size(), 67u);
  EXPECT_EQ(hands.frames.at(5)[0].keypoints[25].y_px, track.frames[5][0].keypoints[95].y_px);  // left hand first
  EXPECT_EQ(hands.frames.at(5)[0].keypoints[46].y_px, track.frames[5][0].keypoints[116].y_px);
}

TEST_F(Pose2d, EmptyHandIsNotDetectedAndWrongOneIsNamed) {
  std::string text = People(75);
  text.replace(text.find("]}]}"), 4, "],\"hand_left_keypoints_2d\":[],\"hand_right_keypoints_2d\":[1,2,3]}]}");
  Put("1.json", text);
  EXPECT_THAT(MessageOf<FormatError>("body25+hands"),
              AllOf(HasSubstr("people[0].hand_right_keypoints_2d"), HasSubstr("3 x 21")));
  text.replace(text.find("[1,2,3]"), 7, "[]");
  Put("1.json", text);
  const Pose2dTrack track = Read("body25+hands");
  EXPECT_EQ(track.frames.at(1)[0].keypoints.size(), 67u);
  EXPECT_EQ(track.frames.at(1)[0].keypoints[66].score, 0);
  EXPECT_EQ(track.frames.at(1)[0].keypoints[24].score, 74.5);
}

TEST_F(Pose2d, AllJointsInOneListSuitASkeletonOfParts) {
  Put("1.json", People(3 * 137));
  EXPECT_EQ(Read("openpose137").frames.at(1)[0].keypoints[136].score, 3 * 137 - 0.5);
}

class Pose2dResults : public Pose2d {
 protected:
  Pose2dTrack ReadText(const std::string& text) const {
    Put("results.json", text);
    return ReadPose2d((folder_ / "results.json").string(), "cam_03", geometry::SkeletonByName("coco17"));
  }
  static std::string Numbers(int count, double first) {
    std::string text = "[";
    for (int i = 0; i < count; ++i) text += (i ? "," : "") + std::to_string(first + i);
    return text + "]";
  }
};

TEST_F(Pose2dResults, CocoAndAlphaPoseLists) {
  const Pose2dTrack track = ReadText(R"([{"image_id":"img_0007.jpg","category_id":1,"score":2.5,"keypoints":)" +
                                     Numbers(51, 1) + R"(},{"image_id":12,"keypoints":)" + Numbers(51, 100) +
                                     R"(},{"image_id":"img_0007.jpg","keypoints":)" + Numbers(51, 200) + "}]");
  ASSERT_EQ(track.frames.size(), 2u);
  ASSERT_EQ(track.frames.at(7).size(), 2u);
  EXPECT_EQ(track.frames.at(7)[1].keypoints[0].x_px, 200);
  EXPECT_EQ(track.frames.at(12)[0].keypoints[16].score, 150);
}

TEST_F(Pose2dResults, MmposePredictions) {
  std::string points = "[", scores = "[";
  for (int k = 0; k < 17; ++k) {
    points += std::string(k ? "," : "") + "[" + std::to_string(k) + ",5]";
    scores += std::string(k ? "," : "") + "0.5";
  }
  const std::string instance = "{\"keypoints\":" + points + "],\"keypoint_scores\":" + scores + "],\"bbox\":[[1,2,3,4]]}";
  const Pose2dTrack track = ReadText("{\"meta_info\":{},\"instance_info\":[{\"frame_id\":1,\"instances\":[" + instance + "," +
                                     instance + "]},{\"frame_id\":2,\"instances\":[]}]}");
  EXPECT_EQ(track.frames.at(1).size(), 2u);
  EXPECT_EQ(track.frames.at(1)[1].keypoints[16].x_px, 16);
  EXPECT_TRUE(track.frames.at(2).empty());
  const Pose2dTrack list = ReadText("[{\"frame_id\":5,\"instances\":[" + instance + "]},{\"frame_id\":6,\"instances\":[]}]");
  EXPECT_EQ(list.frames.at(5).at(0).keypoints[16].x_px, 16);
  EXPECT_TRUE(list.frames.at(6).empty());
}

TEST_F(Pose2dResults, ImagesOfOneNumberAreNotOneFrame) {
  const auto entry = [](const std::string& name) {
    return R"({"image_id":")" + name + R"(","keypoints":)" + Numbers(51, 1) + "}";
  };
  const Pose2dTrack track = ReadText("[" + entry("000005_cam2.jpg") + "," + entry("000009_cam2.jpg") + "]");
  EXPECT_EQ(track.frames.size(), 2u);
  EXPECT_TRUE(track.frames.count(5) && track.frames.count(9));
  const std::string both = "[" + entry("a_7.jpg") + "," + entry("b_7.jpg") + "]";
  EXPECT_THAT(testing::MessageOf<FormatError>([&] { ReadText(both); }), AllOf(HasSubstr("a_7.jpg"), HasSubstr("b_7.jpg")));
}

TEST_F(Pose2dResults, AnnotationsOfCocoAreNumberedByTheirImages) {
  const Pose2dTrack track = ReadText(
      R"({"images":[{"id":900,"file_name":"v/f_0003.jpg"},{"id":17,"file_name":"v/f_0004.jpg"}],"annotations":[{"image_id":17,)"
      R"("keypoints":)" +
      Numbers(51, 1) + R"(},{"image_id":900,"keypoints":)" + Numbers(51, 100) + "}]}");
  EXPECT_EQ(track.frames.at(4)[0].keypoints[0].x_px, 1);
  EXPECT_EQ(track.frames.at(3)[0].keypoints[0].x_px, 100);
  const std::string two = R"({"images":[{"id":1,"file_name":"a/3.jpg"},{"id":2,"file_name":"b/3.jpg"}],"annotations":[]})";
  EXPECT_THAT(testing::MessageOf<FormatError>([&] { ReadText(two); }), AllOf(HasSubstr("a/3.jpg"), HasSubstr("b/3.jpg")));
}

TEST_F(Pose2dResults, WhatCannotBeReadIsListedOrThrown) {
  const std::string good = R"({"image_id":1,"keypoints":)" + Numbers(51, 1) + "}";
  const Pose2dTrack track = ReadText("[" + good + "," + good + R"(,{"image_id":-3,"keypoints":)" + Numbers(51, 1) + "}]");
  EXPECT_THAT(track.skipped, ::testing::ElementsAre(AllOf(HasSubstr("[2]"), HasSubstr("image_id"))));
  const auto message = [this](const std::string& text) { return testing::MessageOf<FormatError>([&] { ReadText(text); }); };
  EXPECT_THAT(message("{\"people\":[]}"), HasSubstr("instance_info"));
  EXPECT_THAT(message("[7]"), HasSubstr("[0]"));
  EXPECT_THAT(message(R"([{"image_id":1,"keypoints":[1,2,3]}])"), HasSubstr("3 x 17"));
  EXPECT_THAT(message(R"([{"image_id":1.5,"keypoints":)" + Numbers(51, 1) + "}]"), HasSubstr("image_id"));
  EXPECT_THAT(message("[{"), HasSubstr("truncated"));
}

TEST_F(Pose2d, PeopleWithoutABodyAreLeftOut) {
  Put("1.json", "{\"people\":[{},{\"pose_keypoints_2d\":[]}," + People(51).substr(25));
  EXPECT_EQ(Read().frames.at(1).size(), 1u);
}

TEST_F(Pose2d, WrongSkeletonNamesTheOneThatFits) {
  Put("1.json", People(75));
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("option 'skeleton' body25 or body25b would fit"));
  Put("1.json", People(18 * 3));
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("coco18"));
  Put("1.json", People(76));
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("no known skeleton"));
}

TEST_F(Pose2d, DuplicateAndMissingFrameNumbers) {
  Put("a_1.json", "{\"people\":[]}");
  Put("b_1.json", "{\"people\":[]}");
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("same frame number"));
  fs::remove(folder_ / "b_1.json");
  Put("pose_keypoints.json", "{\"people\":[]}");
  EXPECT_THAT(MessageOf<FormatError>(), HasSubstr("no frame number"));
}

TEST_F(Pose2d, MutationsNeverCrash) {
  const std::string whole = People(51);
  Rng rng(7);
  int refused = 0;
  for (int trial = 0; trial < 100; ++trial) {
    std::string mutated = whole;
    for (int k = 0; k < 3; ++k)
      mutated[static_cast<size_t>(rng.Index(static_cast<int64_t>(whole.size())))] = static_cast<char>(rng.Index(256));
    Put("1.json", mutated);
    try {
      for (const Person2d& person : Read().frames.at(1)) EXPECT_EQ(person.keypoints.size(), 17u);
    } catch (const FormatError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 30);
}

TEST_F(Pose2d, ReadsRealFilesOfPose2Sim) {
  const char* data = std::getenv("MVSTUDIO_DATA");
  const char* source = std::getenv("MVSTUDIO_SOURCE");
  const fs::path root = data ? fs::path(data) : fs::path(source ? source : ".") / ".." / "shared" / "data";
  const fs::path folder = root / "pose2sim" / "balancing" / "pose" / "cam01_json";
  if (!fs::exists(folder)) GTEST_SKIP() << "data set pose2sim is not there";
  const Pose2dTrack track = ReadOpenPoseFolder(folder.string(), "cam_01", geometry::SkeletonByName("body25b"));
  EXPECT_EQ(track.frames.size(), 100u);
  ASSERT_EQ(track.frames.at(0).size(), 2u);
  EXPECT_EQ(track.frames.at(0)[0].keypoints[0].x_px, 505.232);
  EXPECT_EQ(track.frames.at(0)[0].keypoints[24].score, 0.555979);
}

}  // namespace
}  // namespace mvstudio::dataset
