#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <map>

#include "avatar/body/files/person_file.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/arrays/npz.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/video_io.h"
#include "dataset/pose/pose2d.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig_io.h"
#include "synth/session.h"
#include "tests/support/test.h"

namespace mvstudio::synth {
namespace {

namespace fs = std::filesystem;

class SessionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    root_ = (fs::temp_directory_path() / ("mvstudio_synth_" + std::to_string(::getpid()))).string();
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  static SynthOptions Small() {
    SynthOptions options;
    options.cameras = 3;
    options.size = "160x120";
    options.board_frames = 3;
    options.take_frames = 10;
    options.samples = 2;
    options.texture_px = 32;
    return options;
  }
  std::string Write(const std::string& name, const SynthOptions& options, uint64_t seed, int threads) {
    RunContext run;
    run.seed = seed;
    run.num_threads = threads;
    WriteSession(options, root_ + "/" + name, false, run);
    return root_ + "/" + name;
  }
  /// Relative path -> content of every file.
  static std::map<std::string, std::string> Contents(const std::string& folder) {
    std::map<std::string, std::string> contents;
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.is_regular_file()) contents[fs::relative(entry.path(), folder).string()] = ReadFile(entry.path().string());
    }
    return contents;
  }
  std::string root_;
};

TEST_F(SessionTest, SameSeedSameBytesWhateverTheThreads) {
  SynthOptions options = Small();
  options.format = FootageFormat::kPng;
  const auto one = Contents(Write("one", options, 5, 1)), two = Contents(Write("two", options, 5, 3)),
             other = Contents(Write("other", options, 6, 2));
  ASSERT_EQ(one.size(), two.size());
  for (const auto& [path, content] : one) EXPECT_TRUE(two.at(path) == content) << path;
  EXPECT_NE(one.at("raw/take1/cam_01/00000004.png"), other.at("raw/take1/cam_01/00000004.png"));
  EXPECT_NE(one.at("truth/calibration.json"), other.at("truth/calibration.json"));
}

TEST_F(SessionTest, VideosDoNotDependOnTheThreadsEither) {
  const SynthOptions options = Small();
  EXPECT_EQ(ReadFile(Write("one", options, 5, 1) + "/raw/take1/cam_02.mp4"),
            ReadFile(Write("two", options, 5, 4) + "/raw/take1/cam_02.mp4"));
}

TEST_F(SessionTest, LayoutIsCompleteAndMasksEqualParts) {
  const std::string folder = Write("s", Small(), 1, 0);
  const geometry::Rig rig = geometry::ReadRig(folder + "/truth/calibration.json");
  ASSERT_EQ(rig.cameras.size(), 3u);
  const dataset::Pose3d truth = dataset::ReadPose3d(folder + "/truth/pose3d");
  EXPECT_EQ(truth.skeleton, "body25");
  EXPECT_EQ(truth.rows.size(), 250u);
  for (const char* file : {"mvstudio.toml", "truth/board_poses.json"}) EXPECT_TRUE(fs::exists(folder + "/" + file)) << file;
  for (const geometry::RigCamera& camera : rig.cameras) {
    const std::string& name = camera.camera.name;
    dataset::VideoReader video(folder + "/raw/take1/" + name + ".mp4");
    EXPECT_EQ(video.info().width, 160);
    int frames = 0;
    while (video.Next()) ++frames;
    EXPECT_EQ(frames, 10);
    EXPECT_TRUE(fs::exists(folder + "/raw/board/" + name + ".mp4"));
    EXPECT_EQ(dataset::ReadImage(folder + "/raw/plate/" + name + ".png").width, 160);
    for (int f : {0, 9}) {
      const std::string frame = "/take1/" + name + "/0000000" + std::to_string(f) + ".png";
      const Image mask = dataset::ReadImage(folder + "/truth/masks" + frame, true),
                  part = dataset::ReadImage(folder + "/truth/partuv" + frame);
      int area = 0;
      for (size_t i = 0; i < mask.pixels.size(); ++i) {
        EXPECT_EQ(mask.pixels[i], part.pixels[3 * i] > 0 ? 255 : 0);
        EXPECT_LE(part.pixels[3 * i], 24);
        area += mask.pixels[i] > 0;
      }
      EXPECT_GT(area, 500);
    }
  }
}

TEST_F(SessionTest, Joints2dAreProjectionsOfTheTruthPlusNoise) {
  SynthOptions options = Small();
  options.noise_px = 0;
  const std::string folder = Write("s", options, 1, 0);
  const geometry::Rig rig = geometry::ReadRig(folder + "/truth/calibration.json");
  const dataset::Pose3d truth = dataset::ReadPose3d(folder + "/truth/pose3d");
  const geometry::Skeleton& skeleton = geometry::SkeletonByName("body25");
  int seen = 0;
  for (const geometry::RigCamera& camera : rig.cameras) {
    const auto track =
        dataset::ReadOpenPoseFolder(folder + "/pose2d/take1/" + camera.camera.name, camera.camera.name, skeleton);
    for (const dataset::JointRow& row : truth.rows) {
      const dataset::Keypoint2d& point = track.frames.at(row.frame).at(0).keypoints[skeleton.Find(row.joint)];
      if (point.score == 0) continue;
      ++seen;
      const Eigen::Vector2d px = geometry::Project(camera.camera, camera.cam_from_world * row.x_in_world).px;
      EXPECT_LT((px - Eigen::Vector2d(point.x_px, point.y_px)).norm(), 1e-6);
    }
  }
  EXPECT_GT(seen, 500);
}

TEST_F(SessionTest, AnExistingSessionIsKeptUnlessOverwritten) {
  SynthOptions options = Small();
  options.board_frames = 0;
  options.take_frames = 1;
  const std::string folder = Write("s", options, 1, 0);
  const std::string before = ReadFile(folder + "/truth/calibration.json");
  RunContext run;
  run.seed = 2;
  EXPECT_THROW(WriteSession(options, folder, false, run), UsageError);
  EXPECT_EQ(ReadFile(folder + "/truth/calibration.json"), before);
  const SynthSummary summary = WriteSession(options, folder, true, run);
  EXPECT_NE(ReadFile(folder + "/truth/calibration.json"), before);
  EXPECT_EQ(summary.cameras, 3);
  EXPECT_FALSE(fs::exists(folder + "/raw/board"));
}

TEST_F(SessionTest, TheTruthOfASurfaceIsComplete) {
  SynthOptions options = Small();
  options.cameras = 1, options.board_frames = 0, options.take_frames = 3, options.new_motion_frames = 2;
  options.subject = SubjectKind::kCloth, options.take_motion = TakeMotion::kATurn;
  const std::string folder = Write("s", options, 1, 1);
  const auto rest = dataset::ReadNpzMembers(folder + "/truth/subject_rest.npz");
  const NpyArray transforms = ParseNpy(dataset::ReadNpzMembers(folder + "/truth/motion.npz").at("transforms"), "transforms");
  EXPECT_EQ(transforms.shape, (std::vector<int64_t>{5, 19, 3, 4}));
  ASSERT_EQ(ParseNpyTexts(rest.at("names"), "names"), (std::vector<std::string>{"body", "skirt", "shirt"}));
  for (int f = 0; f < 5; ++f) {
    const auto frame = dataset::ReadNpz(folder + "/truth/vertices_0000000" + std::to_string(f) + ".npz");
    for (const char* mesh : {"body", "skirt", "shirt"}) {
      const NpyArray rest_v = ParseNpy(rest.at(std::string(mesh) + "_v"), mesh);
      const NpyArray weights = ParseNpy(rest.at(std::string(mesh) + "_weights"), mesh);
      ASSERT_EQ(frame.at(mesh).shape, rest_v.shape);
      double worst = 0;  // beyond skinning by the written bones
      for (int64_t v = 0; v < rest_v.shape[0]; ++v) {
        for (int r = 0; r < 3; ++r) {
          double skinned = 0;
          for (int b = 0; b < 19; ++b) {
            const double* row = &transforms.values[((f * 19 + b) * 3 + r) * 4];
            const double* x = &rest_v.values[3 * v];
            skinned += weights.values[19 * v + b] * (row[0] * x[0] + row[1] * x[1] + row[2] * x[2] + row[3]);
          }
          worst = std::max(worst, std::abs(skinned - frame.at(mesh).values[3 * v + r]));
        }
      }
      EXPECT_LT(worst, 0.4) << mesh;
      if (mesh == std::string("body")) {
        EXPECT_LT(worst, 0.02);
      } else {
        EXPECT_GT(worst, 0.01) << mesh;
      }
    }
  }
}

TEST_F(SessionTest, ClothIsTheSameWhateverTheThreads) {
  SynthOptions options = Small();
  options.format = FootageFormat::kPng;
  options.cameras = 2, options.board_frames = 0, options.subject = SubjectKind::kCloth, options.take_frames = 9;
  const auto one = Contents(Write("one", options, 5, 1)), two = Contents(Write("two", options, 5, 2));
  ASSERT_EQ(one.size(), two.size());
  for (const auto& [path, content] : one) EXPECT_TRUE(two.at(path) == content) << path;
}

TEST_F(SessionTest, AFittedBodyWalksInItsOwnColours) {
  SynthOptions options = Small();
  options.cameras = 1, options.board_frames = 0, options.take_frames = 2;
  body::PersonFile person;
  person.body = body::MakeMannequin(1.6, 0.5);
  options.body = root_ + "/body.npz";
  body::WritePersonFile(options.body, person);
  const std::string folder = Write("s", options, 1, 1);
  const auto frame = dataset::ReadNpz(folder + "/truth/vertices_00000001.npz");
  EXPECT_EQ(frame.at("body").shape, (std::vector<int64_t>{person.body.vertices.cols(), 3}));
  person.body.bone_roles[4] = body::BoneRole::kOther;  // no head
  body::WritePersonFile(options.body, person);
  EXPECT_THROW(Write("t", options, 1, 1), FormatError);
  options.body = root_ + "/none.npz";
  EXPECT_THROW(Write("t", options, 1, 1), IoError);
  EXPECT_FALSE(fs::exists(root_ + "/t"));
}

TEST_F(SessionTest, ClothThatTearsIsAStatusAndLeavesNothing) {
  SynthOptions options = Small();
  options.cameras = 1, options.board_frames = 0, options.subject = SubjectKind::kCloth;
  body::PersonFile giant;
  giant.body = body::MakeMannequin(1.75, 0.5);
  giant.body.vertices *= 100, giant.body.bone_heads *= 100, giant.body.bone_tails *= 100, giant.body.coco19 *= 100;
  options.body = root_ + "/body.npz";
  body::WritePersonFile(options.body, giant);
  const SynthSummary summary = WriteSession(options, root_ + "/s", false, {});
  EXPECT_EQ(summary.status, Status::kNotConverged);
  EXPECT_EQ(summary.failed_frame, 0);
  EXPECT_FALSE(fs::exists(root_ + "/s"));
}

/// Cancels at the first opportunity.
class Impatient : public ProgressSink {
 public:
  bool Cancelled() const override { return true; }
};

TEST_F(SessionTest, ACancelledRunLeavesNothing) {
  Impatient impatient;
  RunContext run;
  run.progress = &impatient;
  EXPECT_THROW(WriteSession(Small(), root_ + "/s", false, run), CancelledError);
  EXPECT_TRUE(fs::is_empty(root_));
}

}  // namespace
}  // namespace mvstudio::synth
