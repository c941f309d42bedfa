#include <cmath>

#include "core/disk/files.h"
#include "core/error.h"
#include "dataset/detect/joints/joint_maps.h"
#include "dataset/detect/joints/joint_net.h"
#include "dataset/detect/joints/pose_tracker.h"
#include "tests/detect/joint_onnx.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::detect {
namespace {

using dataset::Keypoint2d;
using dataset::Person2d;

/// One Gaussian bump a joint.
JointMaps Bumps(const std::vector<Keypoint2d>& at, int size, double stride, double sigma_px) {
  JointMaps maps;
  maps.joints = static_cast<int>(at.size());
  maps.height = maps.width = size;
  maps.stride_px = stride;
  maps.origin_x_px = maps.origin_y_px = 0.5 * stride - 0.5;
  for (const Keypoint2d& joint : at) {
    for (int y = 0; y < size; ++y) {
      for (int x = 0; x < size; ++x) {
        const double dx = maps.origin_x_px + x * stride - joint.x_px, dy = maps.origin_y_px + y * stride - joint.y_px;
        maps.score.push_back(static_cast<float>(joint.score * std::exp(-(dx * dx + dy * dy) / (2 * sigma_px * sigma_px))));
      }
    }
  }
  return maps;
}

TEST(ReadJoints, FindsGaussianPeaksBetweenCells) {
  for (double shift = 0; shift < 4; shift += 0.37) {
    const std::vector<Keypoint2d> joints =
        ReadJoints(Bumps({{60 + shift, 81 - shift, 0.9}, {20.2, 100 + shift, 0.5}}, 32, 4, 8));
    EXPECT_NEAR(joints[0].x_px, 60 + shift, 1e-3);
    EXPECT_NEAR(joints[0].y_px, 81 - shift, 1e-3);
    EXPECT_NEAR(joints[1].y_px, 100 + shift, 1e-3);
    EXPECT_NEAR(joints[1].score, 0.5, 0.1);
  }
}

TEST(ReadJoints, VotesLeadToTheJointAndStrangersDoNotCount) {
  JointMaps maps = Bumps({{50, 40, 0.9}}, 9, 16, 12);
  maps.dx_px.resize(81), maps.dy_px.resize(81);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 9; ++x) {
      maps.dx_px[y * 9 + x] = static_cast<float>(53.25 - (maps.origin_x_px + 16 * x));
      maps.dy_px[y * 9 + x] = static_cast<float>(38.5 - (maps.origin_y_px + 16 * y));
    }
  }
  maps.dx_px[2 * 9 + 4] += 60;  // a neighbour votes for somebody else
  const Keypoint2d joint = ReadJoints(maps)[0];
  EXPECT_NEAR(joint.x_px, 53.25, 1e-3);
  EXPECT_NEAR(joint.y_px, 38.5, 1e-3);
}

TEST(ReadJoints, ThePriorChoosesThePerson) {
  JointMaps two = Bumps({{30, 30, 0.6}}, 32, 4, 6);
  const JointMaps other = Bumps({{100, 90, 0.7}}, 32, 4, 6);
  for (size_t i = 0; i < two.score.size(); ++i) two.score[i] += other.score[i];
  EXPECT_NEAR(ReadJoints(two)[0].x_px, 100, 0.1);
  two.prior_x_px = {34}, two.prior_y_px = {28}, two.prior_scale_px = 20;
  EXPECT_NEAR(ReadJoints(two)[0].x_px, 30, 0.1);
  for (size_t i = 0; i < two.score.size(); ++i) two.score[i] += 0.43f * other.score[i];
  two.prior_x_px = {50}, two.prior_y_px = {48}, two.prior_scale_px = 40;  // 27 px from one, 65 from the stronger other
  EXPECT_NEAR(ReadJoints(two)[0].x_px, 100, 0.1);
  two.prior_power = 2;
  EXPECT_NEAR(ReadJoints(two)[0].x_px, 30, 0.1);
}

TEST(AverageMirrored, OfAMirroredImageIsTheSame) {
  const int crop_px = 128;
  for (const bool votes : {false, true}) {
    JointMaps maps = Bumps({{40.3, 60, 0.8}, {90, 61, 0.7}, {64, 20, 0.9}}, 32, 4, 7);
    JointMaps rotated = Bumps({{127 - 90.0, 61, 0.7}, {127 - 40.3, 60, 0.8}, {127 - 64.0, 20, 0.9}}, 32, 4, 7);
    if (votes) {
      maps.dx_px.assign(maps.score.size(), 1.5f), maps.dy_px.assign(maps.score.size(), 0.5f);
      rotated.dx_px.assign(maps.score.size(), -1.5f), rotated.dy_px.assign(maps.score.size(), 0.5f);
    }
    const std::vector<Keypoint2d> once = ReadJoints(maps), both = ReadJoints(AverageMirrored(maps, rotated, {{0, 1}}, crop_px));
    for (size_t j = 0; j < 3; ++j) {
      EXPECT_NEAR(once[j].x_px, both[j].x_px, 1e-3);
      EXPECT_NEAR(once[j].y_px, both[j].y_px, 1e-3);
    }
  }
}

/// An image in which red grows along x and green along y.
Image Ramp(int width, int height) {
  Image ramp(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x)
      ramp.Pixel(x, y)[0] = static_cast<uint8_t>(x), ramp.Pixel(x, y)[1] = static_cast<uint8_t>(y);
  }
  return ramp;
}

TEST(CutCrop, PixelsComeFromWhereFromCropSays) {
  const Image ramp = Ramp(240, 200);
  for (const Crop& crop :
       {Crop{120, 100, 64, 0}, Crop{100.4, 90.2, 90, 0.6}, Crop{120, 100, 33, -2.5}, Crop{110, 100, 140, 1.1}}) {
    const Image cut = CutCrop(ramp, crop, 48);
    for (const auto& [x, y] : {std::pair(5, 7), {40, 9}, {24, 24}, {12, 44}}) {
      const Keypoint2d at = FromCrop({static_cast<double>(x), static_cast<double>(y), 1}, crop, 48);
      EXPECT_NEAR(cut.Pixel(x, y)[0], at.x_px, 1.2);
      EXPECT_NEAR(cut.Pixel(x, y)[1], at.y_px, 1.2);
      EXPECT_NEAR(ToCrop(at, crop, 48).x_px, x, 1e-9);
      EXPECT_NEAR(ToCrop(at, crop, 48).y_px, y, 1e-9);
    }
  }
}

TEST(CropAround, TurnsWithTheTrunk) {
  Person2d person{std::vector<Keypoint2d>(17)};
  const double lean = 0.7;  // clockwise
  const auto place = [&](size_t joint, double right, double up) {
    person.keypoints[joint] = {100 + std::cos(lean) * right + std::sin(lean) * up,
                               200 + std::sin(lean) * right - std::cos(lean) * up, 1};
  };
  place(5, 20, 60), place(6, -20, 60), place(11, 15, 0), place(12, -15, 0), place(15, 10, -100), place(16, -10, -100);
  EXPECT_NEAR(LeanOf(person, geometry::SkeletonByName("coco17"), 0.3), lean, 1e-9);
  const Crop crop = CropAround(person, 0.8, 0.1, LeanOf(person, geometry::SkeletonByName("coco17"), 0.3));
  EXPECT_NEAR(crop.size_px, 160 / 0.8, 1e-9);
  EXPECT_NEAR(crop.x_px, 100 - std::sin(lean) * 20, 1e-9);
  EXPECT_NEAR(crop.y_px, 200 + std::cos(lean) * 20, 1e-9);
  EXPECT_EQ(CropAround({std::vector<Keypoint2d>(17)}, 0.8, 0.1).size_px, 0);
}

TEST(OnSkeleton, JointsKeepTheirNamesAndTheTrunkLeansAlike) {
  const geometry::Skeleton &coco = geometry::SkeletonByName("coco17"), &many = geometry::SkeletonByName("mediapipe33");
  Person2d person{std::vector<Keypoint2d>(17)};
  for (size_t j = 0; j < 17; ++j) person.keypoints[j] = {10.0 * static_cast<double>(j), 7.0 - static_cast<double>(j * j), 0.9};
  const Person2d mapped = OnSkeleton(person, coco, many);
  ASSERT_EQ(mapped.keypoints.size(), 33u);
  for (size_t j = 0; j < 33; ++j) {
    const int from = coco.Find(many.joints[j]);
    EXPECT_EQ(mapped.keypoints[j].score, from < 0 ? 0 : 0.9) << many.joints[j];
    EXPECT_EQ(mapped.keypoints[j].x_px, from < 0 ? 0 : 10.0 * from);
  }
  EXPECT_NE(LeanOf(person, coco, 0.3), 0);
  EXPECT_EQ(LeanOf(mapped, many, 0.3), LeanOf(person, coco, 0.3));
  EXPECT_EQ(LeanOf(person, many, 0.3), 0) << "17 joints are no pose of 33";
}

TEST(PoseSimilarity, FallsWithDistance) {
  Person2d a{std::vector<Keypoint2d>(17)};
  for (size_t j = 0; j < 17; ++j) a.keypoints[j] = {10.0 * static_cast<double>(j % 4), 20.0 * static_cast<double>(j), 1};
  Person2d near = a, far = a;
  for (size_t j = 0; j < 17; ++j) near.keypoints[j].x_px += 3, far.keypoints[j].x_px += 300;
  EXPECT_DOUBLE_EQ(PoseSimilarity(a, a, 0.1), 1);
  EXPECT_GT(PoseSimilarity(a, near, 0.1), 0.5);
  EXPECT_LT(PoseSimilarity(a, far, 0.1), 1e-3);
  EXPECT_EQ(PoseSimilarity(a, {std::vector<Keypoint2d>(17)}, 0.1), 0);
}

OnnxOptions TinyOptions() {
  OnnxOptions options;
  options.width_px = 48, options.height_px = 64;
  options.normalization = InputScale::kUnit;
  return options;
}

/// A soft red spot.
Image Spot(int width, int height, double x0, double y0, double sigma) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double r2 = (x - x0) * (x - x0) + (y - y0) * (y - y0);
      image.Pixel(x, y)[0] = static_cast<uint8_t>(std::lround(250 * std::exp(-r2 / (2 * sigma * sigma))));
    }
  }
  return image;
}

TEST(Onnx, HeatMapsOfAFileBecomeJoints) {
  const TempDir folder;
  WriteFileAtomic(folder / "tiny.onnx", TinyOnnx(17));
  const std::unique_ptr<JointNet> net = OpenOnnx(folder / "tiny.onnx", TinyOptions());
  EXPECT_EQ(net->input_px(), 64);
  const Image image = Spot(200, 160, 90.3, 77.6, 8);
  const Crop crop{96, 80, 80, 0};
  const Person2d person = LocateJoints(*net, image, crop, {{1.0}, true});
  ASSERT_EQ(person.keypoints.size(), 17u);
  for (const Keypoint2d& joint : person.keypoints) {
    EXPECT_NEAR(joint.x_px, 90.3, 0.3);
    EXPECT_NEAR(joint.y_px, 77.6, 0.3);
    EXPECT_GT(joint.score, 0.8);
  }
}

TEST(Onnx, OtherNetsAndDamagedFilesAreRefused) {
  const TempDir folder;
  const auto refusal = [&](const std::string& bytes) {
    WriteFileAtomic(folder / "net.onnx", bytes);
    return MessageOf<FormatError>([&] { OpenOnnx(folder / "net.onnx", TinyOptions()); });
  };
  EXPECT_THAT(refusal(TinyOnnx(5)), HasSubstr("5 heat maps, skeleton coco17 has 17 joints"));
  EXPECT_THAT(refusal("not a net"), HasSubstr("net.onnx"));
  EXPECT_THAT(refusal(""), HasSubstr("net.onnx"));
  EXPECT_THROW(OpenOnnx(folder / "missing.onnx", TinyOptions()), IoError);
  InputScale scale = InputScale::kUnit;
  EXPECT_THROW(FromString("hope", &scale), UsageError);
}

TEST(Onnx, EveryCutFileIsRefusedOrStillANet) {
  const TempDir folder;
  const std::string whole = TinyOnnx(17);
  int refused = 0;
  for (size_t length = 0; length < whole.size(); length += whole.size() / 40) {
    WriteFileAtomic(folder / "cut.onnx", whole.substr(0, length));
    try {
      OpenOnnx(folder / "cut.onnx", TinyOptions());
    } catch (const FormatError&) {
      ++refused;
    }
  }
  EXPECT_GE(refused, 40);
}

/// Finds a spot: a net that needs no file.
class SpotNet : public JointNet {
 public:
  const geometry::Skeleton& skeleton() const override { return geometry::SkeletonByName("coco17"); }
  int input_px() const override { return 64; }
  double person_fill() const override { return 0.5; }
  JointMaps Run(const Image& crop, const std::vector<Keypoint2d>& /*expected*/) const override {
    JointMaps maps;
    maps.joints = 17, maps.height = maps.width = 64;
    for (int j = 0; j < 17; ++j) {
      for (int y = 0; y < 64; ++y) {
        for (int x = 0; x < 64; ++x)
          maps.score.push_back(static_cast<float>(crop.Pixel(x, y)[0] - crop.Pixel(x, y)[1]) / 255.0f);
      }
    }
    return maps;
  }
};

TEST(PoseTracker, FollowsAndSaysWhenNobodyIsThere) {
  const SpotNet net;
  PoseOptions options;
  PoseTracker tracker(net, nullptr, options, {{1.0}, false, 1});
  for (int frame = 0; frame < 5; ++frame) {
    const std::vector<TrackedPerson> people = tracker.Next(Spot(160, 120, 60 + 2 * frame, 50, 10));
    ASSERT_EQ(people.size(), 1u);
    EXPECT_EQ(people[0].id, 0);
    EXPECT_NEAR(people[0].pose.keypoints[3].x_px, 60 + 2 * frame, 1.5);
  }
  EXPECT_TRUE(tracker.Next(Image(160, 120, 3)).empty());
  EXPECT_EQ(tracker.Next(Spot(160, 120, 70, 50, 10)).size(), 1u);
}

/// Middle of what is bright in one channel.
Keypoint2d MiddleOf(const Image& image, int channel) {
  double sum = 0, x_sum = 0, y_sum = 0;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double level = std::max(0, image.Pixel(x, y)[channel] - image.Pixel(x, y)[2]);  // grey outside the image
      sum += level, x_sum += level * x, y_sum += level * y;
    }
  }
  return {x_sum / std::max(sum, 1e-9), y_sum / std::max(sum, 1e-9), 1};
}

/// Knows people (red above green) only when they stand upright in the crop.
class UprightNet : public JointNet {
 public:
  const geometry::Skeleton& skeleton() const override { return geometry::SkeletonByName("coco17"); }
  int input_px() const override { return 64; }
  double person_fill() const override { return 0.4; }
  JointMaps Run(const Image& crop, const std::vector<Keypoint2d>& /*expected*/) const override {
    Keypoint2d red = MiddleOf(crop, 0), green = MiddleOf(crop, 1);
    const double lean = std::atan2(red.x_px - green.x_px, green.y_px - red.y_px);
    red.score = green.score = std::abs(lean) < 0.3 ? 0.9 : 0.05;
    std::vector<Keypoint2d> at(17, green);
    std::fill(at.begin(), at.begin() + 7, red);
    return Bumps(at, 32, 2, 4);
  }
};

/// Head red and feet green, leaning clockwise.
Image Leaning(double lean_rad) {
  const double x = 20 * std::sin(lean_rad), y = -20 * std::cos(lean_rad);
  Image image = Spot(200, 160, 100 + x, 80 + y, 4);
  const Image feet = Spot(200, 160, 100 - x, 80 - y, 4);
  for (int v = 0; v < image.height; ++v) {
    for (int u = 0; u < image.width; ++u) image.Pixel(u, v)[1] = feet.Pixel(u, v)[0];
  }
  return image;
}

TEST(PoseTracker, LooksAgainWithRotatedCropsWhenAPersonLeans) {
  const UprightNet net;
  PoseTracker tracker(net, nullptr, PoseOptions(), {{1.0}, false, 1});
  ASSERT_EQ(tracker.Next(Leaning(0)).size(), 1u);
  for (const double lean : {0.6, 1.1, 1.5}) {
    const std::vector<TrackedPerson> people = tracker.Next(Leaning(lean));
    ASSERT_EQ(people.size(), 1u) << lean;
    EXPECT_EQ(people[0].id, 0);
    EXPECT_GT(people[0].score, 0.5);
    EXPECT_NEAR(people[0].pose.keypoints[5].x_px, 100 + 20 * std::sin(lean), 1.5);
    EXPECT_NEAR(people[0].pose.keypoints[11].y_px, 80 + 20 * std::cos(lean), 1.5);
  }
}

TEST(LocateJoints, NothingIsSeenOutsideTheImage) {
  const SpotNet net;
  Image image(100, 80, 3);
  const Person2d person = LocateJoints(net, image, {50, 40, 80, 0}, {{1.0}, false});
  EXPECT_EQ(person.keypoints[0].score, 0);
  const Person2d beside = LocateJoints(net, Spot(100, 80, 30, 40, 6), {0, 40, 90, 0}, {{1.0}, false});
  EXPECT_GT(beside.keypoints[0].score, 0.5);
  const UprightNet everywhere;  // answers wherever the crop is
  for (const Keypoint2d& joint : LocateJoints(everywhere, image, {-100, -100, 40, 0}, {{1.0}, false}).keypoints)
    EXPECT_EQ(joint.score, 0);
}

TEST(PoseQuality, HasAPlanForEachAndRefusesOthers) {
  PoseQuality quality = PoseQuality::kBalanced;
  for (const char* word : {"fast", "balanced", "exact"}) {
    FromString(word, &quality);
    EXPECT_EQ(ToString(quality), word);
    EXPECT_EQ(PlanOf(quality).scales.size(), quality == PoseQuality::kExact ? 3u : 1u);
  }
  EXPECT_THROW(FromString("best", &quality), UsageError);
}

}  // namespace
}  // namespace mvstudio::detect
