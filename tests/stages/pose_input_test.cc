#include "stages/input/pose_input.h"

#include <numeric>

#include "core/error.h"
#include "geometry/rig/rig_io.h"
#include "tests/support/folder_state.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/triangulate/support.h"

namespace mvstudio::stages {
namespace {

using triangulate::DetectedFrame;

/// Pinhole cameras in a row that look at the origin.
geometry::Rig RowOf(const std::vector<std::string>& names) {
  geometry::Rig rig;
  rig.gauge = geometry::RigGauge::Other("test");
  for (const std::string& name : names) {
    rig.cameras.push_back(triangulate::LookAt(name, {static_cast<double>(rig.cameras.size()), 3, 0.5}, {0, 0, 0}));
  }
  return rig;
}

std::string PutRig(const TempDir& folder, const std::vector<std::string>& names) {
  geometry::WriteRig(RowOf(names), folder / "calib.json");
  return folder / "calib.json";
}

/// A folder of OpenPose files; where a joint is tells its camera, frame and number. Returns the word for the option.
NamedPath PutPoses(const TempDir& folder, const std::string& camera, const std::vector<int>& frames, double score = 0.75) {
  dataset::Pose2dTrack track{camera, {}};
  for (const int frame : frames) {
    dataset::Person2d person;
    for (int j = 0; j < 25; ++j) person.keypoints.push_back({100.0 * frame + j, 0.5 * j + camera.front(), score});
    track.frames[frame].push_back(person);
  }
  dataset::WriteOpenPoseFolder(track, folder / camera);
  return {camera, folder / camera};
}

void ExpectSame(const std::vector<DetectedFrame>& a, const std::vector<DetectedFrame>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t f = 0; f < a.size(); ++f) {
    EXPECT_EQ(a[f].frame, b[f].frame);
    ASSERT_EQ(a[f].people.size(), b[f].people.size());
    for (size_t c = 0; c < a[f].people.size(); ++c) {
      ASSERT_EQ(a[f].people[c].size(), b[f].people[c].size()) << "frame " << a[f].frame << ", camera " << c;
      for (size_t p = 0; p < a[f].people[c].size(); ++p) {
        for (size_t j = 0; j < a[f].people[c][p].size(); ++j) {
          EXPECT_EQ(a[f].people[c][p][j].px, b[f].people[c][p][j].px);
          EXPECT_EQ(a[f].people[c][p][j].score, b[f].people[c][p][j].score);
        }
      }
    }
  }
}

/// All frames, `length` at a time.
std::vector<DetectedFrame> ReadInParts(const PoseParts& parts, size_t length, InputNotes* result) {
  std::vector<DetectedFrame> frames;
  for (size_t begin = 0; begin < parts.num_frames(); begin += length) {
    for (DetectedFrame& frame : parts.Read(begin, begin + length, result)) frames.push_back(std::move(frame));
  }
  return frames;
}

TEST(PoseInput, FoldersOfTwoCamerasOfThree) {
  const TempDir folder;
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b", "c"});
  arguments.pose2d = {PutPoses(folder, "c", {4, 6}), PutPoses(folder, "a", {6, 7})};
  InputNotes result;
  const PoseInput input = ReadPoseInput(arguments, &result);
  EXPECT_THAT(input.cameras, ElementsAre("c", "a"));
  EXPECT_EQ(input.skeleton.name, "body25");
  ASSERT_EQ(input.frames.size(), 3u);
  EXPECT_EQ(input.frames[1].frame, 6);
  ASSERT_EQ(input.frames[1].people.size(), 3u) << "a place for every camera of the rig";
  EXPECT_EQ(input.frames[1].people[1].size(), 0u);
  EXPECT_EQ(input.frames[1].people[0][0][3].px, Eigen::Vector2d(603, 1.5 + 'a'));
  EXPECT_EQ(input.frames[1].people[2][0][3].score, 0.75);
  EXPECT_TRUE(input.frames[0].people[0].empty());
  EXPECT_THAT(result.inputs, ElementsAre(arguments.calib, folder / "c", folder / "a"));
  EXPECT_FALSE(result.partial);
  EXPECT_TRUE(result.warnings.empty());
}

/// Of six frames one program calls the first 0, the other 1.
TEST(PoseInput, FramesFromOneBesideFramesFromZeroAreMoved) {
  const TempDir folder;
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b"});
  arguments.pose2d = {PutPoses(folder, "a", {0, 1, 2, 3, 4, 5}), PutPoses(folder, "b", {1, 2, 3, 4, 5, 6})};
  const auto pixel_of_b = [&](size_t frame, InputNotes* notes) {
    const PoseInput input = ReadPoseInput(arguments, notes);
    return input.frames.at(frame).people.at(1).at(0)[0].px.x();
  };
  InputNotes found, stated, kept;
  EXPECT_EQ(pixel_of_b(2, &found), 300) << "the file's frame 3";
  ASSERT_EQ(found.warnings.size(), 1u);
  EXPECT_EQ(found.warnings[0].code, "POSE-FIRST");
  EXPECT_THAT(found.warnings[0].text, AllOf(HasSubstr("of b are numbered 1 to 6"), HasSubstr("a 0 to 5")));
  arguments.changes.first_frame = {{"b", "1"}};
  EXPECT_EQ(pixel_of_b(2, &stated), 300);
  EXPECT_TRUE(stated.warnings.empty());
  arguments.changes.first_frame = {{"", "0"}};
  EXPECT_EQ(pixel_of_b(2, &kept), 200);
  arguments.changes.first_frame = {{"", "1"}};
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadPoseInput(arguments, &kept); }), HasSubstr("camera a: frame 0: is before"));
  arguments.changes.first_frame = {{"", "half"}};
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadPoseInput(arguments, &kept); }), HasSubstr("option 'first-frame'"));
}

TEST(PoseInput, ACameraThatFilmedLessIsNamed) {
  const TempDir folder;
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b"});
  std::vector<int> whole(20), part(12);
  std::iota(whole.begin(), whole.end(), 0), std::iota(part.begin(), part.end(), 3);
  arguments.pose2d = {PutPoses(folder, "a", whole), PutPoses(folder, "b", part)};
  InputNotes result;
  ReadPoseInput(arguments, &result);
  ASSERT_EQ(result.warnings.size(), 1u);
  EXPECT_EQ(result.warnings[0].code, "POSE-FRAMES-DIFFER");
  EXPECT_THAT(result.warnings[0].text, AllOf(HasSubstr("of 20 frames (0 to 19)"), HasSubstr("b has 12 (3 to 14)")));
}

TEST(PoseInput, ATableOfPoints) {
  const TempDir folder;
  Put(folder / "points.csv",
      "camera,frame,person,joint,x_px,y_px,score\n"
      "a,3,0,tail,1,2,0.5\na,3,0,beak,3,4,1\nb,5,0,beak,5,6,1\nb,3,0,tail,7,8,1\n");
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b"});
  arguments.points2d = folder / "points.csv";
  InputNotes result;
  const PoseInput input = ReadPoseInput(arguments, &result);
  EXPECT_THAT(input.skeleton.joints, ElementsAre("tail", "beak"));
  EXPECT_TRUE(input.limbs.empty());
  ASSERT_EQ(input.frames.size(), 2u);
  EXPECT_EQ(input.frames[0].people[0][0][1].px, Eigen::Vector2d(3, 4));
  EXPECT_EQ(input.frames[1].people[1][0][0].score, 0) << "the tail was not detected";
  InputNotes own;
  const PoseParts parts(arguments, &own);
  ExpectSame(ReadInParts(parts, 1, &own), input.frames);
  EXPECT_TRUE(parts.input().frames.empty());
  EXPECT_TRUE(parts.input().tracks.empty());
}

/// Percent of one camera beside shares of the other; in parts as in the whole.
TEST(PoseInput, ScoresInPercentBecomeSharesAndAreSaid) {
  const TempDir folder;
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b"});
  arguments.pose2d = {PutPoses(folder, "a", {0, 1, 2, 3}, 75), PutPoses(folder, "b", {0, 1, 2, 3}, 0.5)};
  InputNotes whole, chunked;
  const PoseInput input = ReadPoseInput(arguments, &whole);
  EXPECT_EQ(input.frames[0].people[0][0][0].score, 0.75);
  EXPECT_EQ(input.frames[0].people[1][0][0].score, 0.5);
  ASSERT_EQ(whole.warnings.size(), 1u);
  EXPECT_EQ(whole.warnings[0].code, "POSE-SCORES");
  EXPECT_THAT(whole.warnings[0].text, AllOf(HasSubstr("camera a"), HasSubstr("percent")));
  const PoseParts parts(arguments, &chunked);
  ExpectSame(ReadInParts(parts, 1, &chunked), input.frames);
  ASSERT_EQ(chunked.warnings.size(), 1u);
  EXPECT_EQ(chunked.warnings[0].text, whole.warnings[0].text);
}

TEST(PoseInput, LogitsAreRefusedUnlessScoresAreIgnored) {
  const TempDir folder;
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b"});
  arguments.pose2d = {PutPoses(folder, "a", {0, 1}, -2.5), PutPoses(folder, "b", {0, 1})};
  InputNotes result;
  EXPECT_THAT(MessageOf<FormatError>([&] { ReadPoseInput(arguments, &result); }),
              AllOf(HasSubstr("camera a"), HasSubstr("logits"), HasSubstr("ignore-scores")));
  arguments.changes.ignore_scores = true;
  EXPECT_EQ(ReadPoseInput(arguments, &result).frames[0].people[0][0][0].score, 1);
}

TEST(PoseInput, PartsTogetherAreTheWhole) {
  const TempDir folder;
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b", "c"});
  arguments.pose2d = {PutPoses(folder, "a", {3, 5, 6, 7, 9, 12, 13}), PutPoses(folder, "b", {5, 7, 8, 13})};
  InputNotes result;
  const PoseInput whole = ReadPoseInput(arguments, &result);
  for (const size_t length : {1, 2, 3, 100}) {
    InputNotes own;
    const PoseParts parts(arguments, &own);
    EXPECT_EQ(parts.num_frames(), whole.frames.size());
    ExpectSame(ReadInParts(parts, length, &own), whole.frames);
    EXPECT_FALSE(own.partial);
    EXPECT_EQ(parts.input().cameras, whole.cameras);
    EXPECT_EQ(parts.input().limbs, whole.limbs);
    EXPECT_TRUE(parts.Read(parts.num_frames(), parts.num_frames() + 1, &own).empty());
  }
}

/// A whole take with one damaged file is read; so it is when that file is a part by itself.
TEST(PoseInput, ADamagedFileAloneInItsPartIsLeftOutToo) {
  const TempDir folder;
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b"});
  arguments.pose2d = {PutPoses(folder, "a", {0, 1, 2}), PutPoses(folder, "b", {0, 1, 2})};
  Put(folder / "a/000000000001_keypoints.json", "{");
  InputNotes result, own;
  const PoseInput whole = ReadPoseInput(arguments, &result);
  const PoseParts parts(arguments, &own);
  std::vector<DetectedFrame> frames;
  ASSERT_NO_THROW(frames = ReadInParts(parts, 1, &own));
  ExpectSame(frames, whole.frames);
  EXPECT_TRUE(own.partial);
}

TEST(PoseInput, WrongArgumentsAreRefusedByName) {
  const TempDir folder;
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b"});
  const NamedPath a = PutPoses(folder, "a", {1}), b = PutPoses(folder, "b", {1});
  const auto refused = [&](const std::vector<NamedPath>& pose2d, const std::string& points2d) {
    PoseArguments wrong = arguments;
    wrong.pose2d = pose2d, wrong.points2d = points2d;
    InputNotes result;
    return MessageOf<UsageError>([&] { ReadPoseInput(wrong, &result); });
  };
  EXPECT_THAT(refused({}, ""), HasSubstr("either option 'pose2d' or option 'points2d'"));
  EXPECT_THAT(refused({a, b}, "points.csv"), HasSubstr("either option 'pose2d' or option 'points2d'"));
  EXPECT_THAT(refused({a}, ""), HasSubstr("at least two cameras"));
  EXPECT_THAT(refused({a, b, a}, ""), HasSubstr("option 'pose2d' names camera a twice"));
  arguments.skeleton = "ghost";
  EXPECT_THAT(refused({a, b}, ""), HasSubstr("ghost"));
  arguments.skeleton.clear();
  arguments.calib = folder / "none.json";
  arguments.pose2d = {a, b};
  InputNotes result;
  EXPECT_THAT(MessageOf<IoError>([&] { ReadPoseInput(arguments, &result); }), HasSubstr("none.json"));
}

TEST(PoseInput, PartsRefuseWhatTheWholeRefuses) {
  const TempDir folder;
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b"});
  const NamedPath a = PutPoses(folder, "a", {1}), b = PutPoses(folder, "b", {1});
  const auto refused = [&](const std::vector<NamedPath>& pose2d) {
    PoseArguments wrong = arguments;
    wrong.pose2d = pose2d;
    InputNotes result;
    return MessageOf<UsageError>([&] { PoseParts(wrong, &result).Read(0, 1, &result); });
  };
  EXPECT_THAT(refused({}), HasSubstr("either option 'pose2d' or option 'points2d'"));
  EXPECT_THAT(refused({a, b, a}), HasSubstr("names camera a twice"));
  EXPECT_THAT(refused({a}), HasSubstr("at least two cameras"));
}

TEST(PoseInput, JointsThatAreLeftOutAreSeenByNobody) {
  const TempDir folder;
  PoseArguments arguments;
  arguments.calib = PutRig(folder, {"a", "b"});
  arguments.pose2d = {PutPoses(folder, "a", {0, 1}), PutPoses(folder, "b", {0, 1})};
  arguments.without_joints = {"Nose", "LWrist"};
  InputNotes result;
  const PoseInput input = ReadPoseInput(arguments, &result);
  for (size_t j = 0; j < 25; ++j) {
    const std::string& name = input.skeleton.joints[j];
    EXPECT_EQ(input.frames[1].people[0][0][j].score > 0, name != "Nose" && name != "LWrist") << name;
  }
  InputNotes own;
  const PoseParts parts(arguments, &own);
  ExpectSame(ReadInParts(parts, 1, &own), input.frames);
  arguments.without_joints = {"Nase"};
  EXPECT_THAT(MessageOf<UsageError>([&] { ReadPoseInput(arguments, &result); }), HasSubstr("Nose"));
}

}  // namespace
}  // namespace mvstudio::stages
