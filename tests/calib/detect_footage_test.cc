#include "calib/detect/detect_footage.h"

#include <algorithm>
#include <fstream>
#include <memory>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "tests/calib/synthetic.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// Footage of given images; counts how many were asked for.
Footage FootageOf(const std::string& camera, const std::vector<Image>& images, std::shared_ptr<int> asked = {},
                  const std::string& path = "memory") {
  Footage footage;
  footage.camera = camera;
  footage.path = path;
  footage.num_frames = static_cast<int64_t>(images.size());
  auto position = std::make_shared<size_t>(0);
  footage.next = [images, position, asked]() -> std::optional<FootageFrame> {
    if (asked) ++*asked;
    if (*position == images.size()) return std::nullopt;
    const auto k = static_cast<int64_t>((*position)++);
    return FootageFrame{k, "frame " + std::to_string(k), images[k]};
  };
  return footage;
}

Image Render(const Board& board, const Eigen::Vector3d& rotation, double depth) {
  geometry::Rigid3 pose;
  pose.rotation = geometry::RotationExp(rotation);
  pose.translation = Eigen::Vector3d(0, 0, depth) - pose.rotation * Eigen::Vector3d(CornersInBoard(board).rowwise().mean());
  return RenderBoard(board, MakeCamera("c", geometry::LensModel::kPinhole, 620), pose, 2);
}

std::vector<Image> Waving(const Board& board, int count) {
  std::vector<Image> images;
  for (int i = 0; i < count; ++i) images.push_back(Render(board, {0.1 * i - 0.2, 0.3 - 0.1 * i, 0.4 * i}, 2.5 + 0.1 * i));
  return images;
}

FootageOptions Uncached() {
  FootageOptions options;
  options.cache.kind = CachePlace::Kind::kOff;
  return options;
}

void ExpectSame(const std::vector<FootageDetections>& a, const std::vector<FootageDetections>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t c = 0; c < a.size(); ++c) {
    EXPECT_EQ(a[c].reasons, b[c].reasons);
    EXPECT_EQ(a[c].notes, b[c].notes);
    EXPECT_EQ(a[c].num_images, b[c].num_images);
    EXPECT_EQ(a[c].camera.width_px, b[c].camera.width_px);
    EXPECT_EQ(a[c].num_corners_dropped, b[c].num_corners_dropped);
    ASSERT_EQ(a[c].detections.size(), b[c].detections.size());
    for (size_t i = 0; i < a[c].detections.size(); ++i) {
      EXPECT_EQ(a[c].detections[i].frame_idx, b[c].detections[i].frame_idx);
      EXPECT_EQ(a[c].detections[i].board_idx, b[c].detections[i].board_idx);
      EXPECT_EQ(a[c].detections[i].camera_idx, b[c].detections[i].camera_idx);
      EXPECT_EQ(a[c].detections[i].corner_ids, b[c].detections[i].corner_ids);
      EXPECT_EQ(a[c].detections[i].points_px, b[c].detections[i].points_px);
    }
  }
}

TEST(DetectFootage, ResultDoesNotDependOnTheThreads) {
  const Board board = ParseBoard("charuco:7x5:140mm:105mm");
  std::vector<Image> images = Waving(board, 6);
  images.insert(images.begin() + 2, Image(640, 480, 1, 200));
  std::vector<std::vector<FootageDetections>> results;
  for (const int threads : {1, 4, 7}) {
    std::vector<Footage> footage;
    footage.push_back(FootageOf("a", images));
    footage.push_back(FootageOf("b", {images[0], images[3]}));
    RunContext run;
    run.num_threads = threads;
    results.push_back(DetectFootage(board, footage, Uncached(), run));
  }
  ASSERT_EQ(results[0][0].detections.size(), 6u);
  EXPECT_EQ(results[0][0].num_images, 7);
  EXPECT_EQ(results[0][0].reasons.at("no marker of the board found"), 1);
  EXPECT_EQ(results[0][0].detections[2].frame_idx, 3);
  EXPECT_EQ(results[0][1].detections[0].camera_idx, 1);
  ExpectSame(results[0], results[1]);
  ExpectSame(results[0], results[2]);
}

TEST(DetectFootage, SeveralBoards) {
  const std::vector<Board> boards = {ParseBoard("tag:36h11:7:300mm"), ParseBoard("tag:36h11:8:300mm"),
                                     ParseBoard("tag:36h11:9:300mm")};
  std::vector<Footage> footage;
  footage.push_back(FootageOf("a", {Render(boards[0], {0.2, 0.1, 0}, 2), Render(boards[1], {0.2, 0.1, 0}, 2)}));
  const auto found = DetectFootage(boards, footage, Uncached(), RunContext());
  ASSERT_EQ(found[0].detections.size(), 2u);
  EXPECT_EQ(found[0].detections[0].board_idx, 0);
  EXPECT_EQ(found[0].detections[1].board_idx, 1);
  EXPECT_EQ(found[0].reasons.at("tag:36h11:7:300mm: no tag of the board found"), 1);
  ASSERT_EQ(found[0].notes.size(), 1u);
  EXPECT_NE(found[0].notes[0].find("tag:36h11:9:300mm was never seen"), std::string::npos);
  const CalibrateInput input = ToCalibrateInput(boards, found);
  EXPECT_EQ(input.boards.size(), 3u);
  EXPECT_EQ(input.detections.size(), 2u);
}

/// An image that shows one row of markers alone fits both layouts; the other images decide for it.
TEST(DetectFootage, LayoutIsDecidedForAllImagesTogether) {
  const Board printed = ParseBoard("charuco:7x6:120mm:90mm:4x4_250:legacy"),
              claimed = ParseBoard("charuco:7x6:120mm:90mm:4x4_250");
  std::vector<Image> images = Waving(printed, 3);
  Image strip = Render(printed, {0, 0, 0}, 1.8);
  for (int v = 0; v < strip.height; ++v) {
    if (v < 232 || v > 282) std::fill(strip.Pixel(0, v), strip.Pixel(0, v) + strip.width, 128);
  }
  images.push_back(strip);
  std::vector<Footage> footage, asked;
  footage.push_back(FootageOf("a", images));
  FootageOptions options = Uncached();
  options.detect.min_corners = 4;
  const auto found = DetectFootage(claimed, footage, options, RunContext());
  EXPECT_GE(found[0].detections.size(), 3u);
  ASSERT_EQ(found[0].notes.size(), 1u);
  EXPECT_NE(found[0].notes[0].find("charuco:7x6:120mm:90mm:4x4_250:legacy"), std::string::npos) << found[0].notes[0];
  asked.push_back(FootageOf("a", images));
  const auto told = DetectFootage(printed, asked, options, RunContext());
  ASSERT_EQ(told[0].detections.size(), found[0].detections.size());
  for (size_t i = 0; i < told[0].detections.size(); ++i) {
    EXPECT_EQ(told[0].detections[i].points_px, found[0].detections[i].points_px);
  }
}

/// A twelfth of the contrast left, and noise.
Image Dim(const Image& image, uint64_t seed) {
  Image dim = image;
  Rng rng(seed);
  for (uint8_t& value : dim.pixels)
    value = static_cast<uint8_t>(std::lround(std::clamp(60 + (value - 128) * 0.12 + 3.6 * rng.Normal(), 0.0, 255.0)));
  return dim;
}

TEST(DetectFootage, SoftImagesAreTakenWhereTheyAreMost) {
  const Board board = ParseBoard("charuco:7x5:140mm:105mm");
  const std::vector<Image> sharp = Waving(board, 6);
  const auto found = [&](size_t num_dim, double max_misfit) {
    std::vector<Image> images = sharp;
    for (size_t i = 0; i < num_dim; ++i) images[i] = Dim(sharp[i], i + 1);
    std::vector<Footage> footage = {FootageOf("one", images)};
    FootageOptions options = Uncached();
    options.detect.max_misfit = max_misfit;
    options.all_cameras = false;
    return DetectFootage(board, footage, options, RunContext())[0];
  };
  const FootageDetections clean = found(0, 0);
  EXPECT_TRUE(clean.soft.empty());
  const FootageDetections most = found(5, 0);
  ASSERT_EQ(most.soft.size(), 1u);
  EXPECT_TRUE(most.soft[0].taken && most.soft[0].many);
  EXPECT_NE(most.soft[0].text.find("5 of 6 boards"), std::string::npos) << most.soft[0].text;
  ASSERT_EQ(most.detections.size(), 6u);
  for (size_t i = 0; i < 6; ++i) {
    const Detection &soft = most.detections[i], &truth = clean.detections[i];
    EXPECT_GE(soft.num_corners(), 20) << i;
    if (i < 5) {
      EXPECT_GT(soft.sigma_px, 1.5) << "beside a sharp board";
    } else {
      EXPECT_EQ(soft.sigma_px, 1);
    }
    for (int k = 0; k < soft.num_corners(); ++k) {
      const auto same = std::find(truth.corner_ids.begin(), truth.corner_ids.end(), soft.corner_ids[static_cast<size_t>(k)]);
      if (same == truth.corner_ids.end()) continue;
      EXPECT_LT((soft.points_px.col(k) - truth.points_px.col(same - truth.corner_ids.begin())).norm(), 1) << i;
    }
  }
  const FootageDetections few = found(2, 0);
  ASSERT_EQ(few.soft.size(), 1u);
  EXPECT_FALSE(few.soft[0].taken);
  EXPECT_NE(few.soft[0].text.find("2 of 6 boards"), std::string::npos) << few.soft[0].text;
  EXPECT_EQ(few.detections.size(), 4u);
  EXPECT_EQ(found(2, kSoftMisfit).detections.size(), 6u) << "as the text says";
  EXPECT_TRUE(found(5, kSharpMisfit).soft.empty());
  EXPECT_EQ(found(5, kSharpMisfit).detections.size(), 1u);
}

TEST(DetectFootage, SaysWhenTheImagesAreMirrored) {
  const Board board = ParseBoard("charuco:7x5:140mm:105mm");
  std::vector<Image> images = Waving(board, 2);
  for (Image& image : images) {
    for (int v = 0; v < image.height; ++v) std::reverse(image.Pixel(0, v), image.Pixel(0, v) + image.width);
  }
  std::vector<Footage> footage;
  footage.push_back(FootageOf("a", images));
  const std::string message = MessageOf<FormatError>([&] { DetectFootage(board, footage, Uncached(), RunContext()); });
  EXPECT_NE(message.find("mirror"), std::string::npos) << message;
}

/// Flipped images, said to be so, give the corners of the images as they were.
TEST(DetectFootage, MirroredFootageIsSearchedAsIfItWereNot) {
  const Board board = ParseBoard("charuco:7x5:140mm:105mm");
  const std::vector<Image> images = Waving(board, 2);
  std::vector<Image> flipped;
  for (const Image& image : images) flipped.push_back(FlippedLeftRight(image));
  EXPECT_EQ(FlippedLeftRight(flipped[0]).pixels, images[0].pixels);
  std::vector<Footage> plain, mirrored;
  plain.push_back(FootageOf("a", images)), mirrored.push_back(FootageOf("a", flipped));
  mirrored[0].mirrored = true;
  ExpectSame(DetectFootage(board, plain, Uncached(), RunContext()), DetectFootage(board, mirrored, Uncached(), RunContext()));
}

TEST(DetectFootage, ABadCameraIsNamedAndLeavesTheOthers) {
  const Board board = ParseBoard("charuco:7x5:140mm:105mm");
  const std::vector<Image> images = Waving(board, 2);
  const auto all = [&] {
    std::vector<Footage> footage;
    footage.push_back(FootageOf("good", images));
    footage.push_back(FootageOf("blind", {Image(64, 48, 1)}));
    footage.push_back(FootageOf("mixed", {images[0], Image(48, 64, 1)}));
    footage.push_back(FootageOf("flipped", {FlippedLeftRight(images[0])}));
    return footage;
  };
  FootageOptions options = Uncached();
  std::vector<Footage> footage = all();
  EXPECT_THROW(DetectFootage(board, footage, options, RunContext()), FormatError);
  options.all_cameras = false;
  footage = all();
  const auto found = DetectFootage(board, footage, options, RunContext());
  EXPECT_EQ(found[0].detections.size(), 2u);
  EXPECT_EQ(found[0].failure, "");
  EXPECT_NE(found[1].failure.find("was not found in any of 1 images"), std::string::npos) << found[1].failure;
  EXPECT_NE(found[2].failure.find("one size"), std::string::npos) << found[2].failure;
  EXPECT_TRUE(found[2].detections.empty());
  EXPECT_NE(found[3].failure.find("'mirrored' flipped"), std::string::npos) << found[3].failure;
  footage = all();
  footage.erase(footage.begin());
  EXPECT_THROW(DetectFootage(board, footage, options, RunContext()), FormatError) << "nobody sees the board";
}

TEST(DetectFootage, RefusesMixedSizesAndRepeatedNumbers) {
  const Board board = ParseBoard("tag:36h11:7:300mm");
  std::vector<Footage> footage;
  footage.push_back(FootageOf("a", {Image(64, 48, 1), Image(48, 64, 1)}));
  EXPECT_NE(MessageOf<FormatError>([&] { DetectFootage(board, footage, Uncached(), RunContext()); }).find("one size"),
            std::string::npos);
  footage[0] = FootageOf("a", {});
  auto asked = std::make_shared<int>(0);
  footage[0].next = [asked] { return FootageFrame{3, ++*asked == 1 ? "left_3.jpg" : "right_3.jpg", Image(64, 48, 1)}; };
  const std::string twice = MessageOf<FormatError>([&] { DetectFootage(board, footage, Uncached(), RunContext()); });
  EXPECT_NE(twice.find("right_3.jpg: camera a has number 3 twice, first in left_3.jpg"), std::string::npos) << twice;
}

class Impatient : public ProgressSink {
 public:
  bool Cancelled() const override { return true; }
};

TEST(DetectFootage, CanBeCancelled) {
  Impatient sink;
  RunContext run;
  run.progress = &sink;
  run.num_threads = 3;
  std::vector<Footage> footage;
  footage.push_back(FootageOf("a", std::vector<Image>(20, Image(64, 48, 1))));
  EXPECT_THROW(DetectFootage(ParseBoard("tag:36h11:7:300mm"), footage, Uncached(), run), CancelledError);
}

class CachedFootage : public ::testing::Test {
 protected:
  std::vector<FootageDetections> Detect(const std::string& board, int every = 1) {
    std::vector<Footage> footage;
    footage.push_back(FootageOf("a", images_, asked_, folder_ / "video"));
    footage[0].step_of_frame = steps_;
    FootageOptions options;
    options.cache = CacheIn(folder_ / "cache");
    options.every = every;
    *asked_ = 0;
    return DetectFootage(ParseBoard(board), footage, options, RunContext());
  }
  void WriteVideo(const std::string& content) { WriteFileAtomic(folder_ / "video", content); }

  TempDir folder_;
  std::vector<Image> images_ = Waving(ParseBoard("charuco:7x6:120mm:90mm:4x4_250:legacy"), 3);
  std::shared_ptr<int> asked_ = std::make_shared<int>(0);
  std::map<int64_t, int64_t> steps_;
};

TEST_F(CachedFootage, IsNotSearchedAgain) {
  WriteVideo("one");
  const auto first = Detect("charuco:7x6:120mm:90mm:4x4_250");
  EXPECT_FALSE(first[0].cached);
  EXPECT_GT(*asked_, 0);
  const auto second = Detect("charuco:7x6:120mm:90mm:4x4_250");
  EXPECT_TRUE(second[0].cached);
  EXPECT_EQ(*asked_, 0);
  ExpectSame(first, second);
}

TEST_F(CachedFootage, DependsOnContentBoardAndOptions) {
  WriteVideo("one");
  Detect("charuco:7x6:120mm:90mm:4x4_250");
  EXPECT_FALSE(Detect("charuco:7x6:120mm:90mm:4x4_250:legacy")[0].cached);
  EXPECT_FALSE(Detect("charuco:7x6:120mm:90mm:4x4_250", 2)[0].cached);
  EXPECT_TRUE(Detect("charuco:7x6:120mm:90mm:4x4_250")[0].cached);
  WriteVideo("two");
  EXPECT_FALSE(Detect("charuco:7x6:120mm:90mm:4x4_250")[0].cached);
}

/// Camera b lost its frame 1: its frame 1 shows time step 2, and its frame 3 none.
TEST(DetectFootage, FramesCarryTheirTimeSteps) {
  const Board board = ParseBoard("charuco:7x5:140mm:105mm");
  const std::vector<Image> images = Waving(board, 4);
  std::vector<Footage> footage;
  footage.push_back(FootageOf("a", images));
  footage.push_back(FootageOf("b", images));
  footage[1].step_of_frame = {{0, 0}, {1, 2}, {2, 4}};
  FootageOptions options = Uncached();
  const auto steps = [&](const FootageOptions& how) {
    for (size_t c = 0; c < 2; ++c) footage[c].next = FootageOf("", images).next;
    std::vector<int64_t> found;
    const auto camera = DetectFootage(board, footage, how, RunContext())[1];
    for (const Detection& d : camera.detections) found.push_back(d.frame_idx);
    return std::pair(found, camera.num_images);
  };
  EXPECT_EQ(steps(options), std::pair(std::vector<int64_t>({0, 2, 4}), 4));
  options.every = 4;  // of the time steps, so that the cameras' searched frames belong together
  EXPECT_EQ(steps(options), std::pair(std::vector<int64_t>({0, 4}), 2));
}

TEST_F(CachedFootage, ServesOtherTimeStepsAsLongAsAllFramesAreSearched) {
  WriteVideo("one");
  const std::string board = "charuco:7x6:120mm:90mm:4x4_250";
  const auto first = Detect(board);
  steps_ = {{0, 5}, {1, 6}, {2, 8}};
  const auto moved = Detect(board);
  EXPECT_TRUE(moved[0].cached);
  ASSERT_EQ(moved[0].detections.size(), 3u);
  EXPECT_EQ(moved[0].detections[2].frame_idx, 8);
  EXPECT_EQ(moved[0].detections[2].points_px, first[0].detections[2].points_px);
  EXPECT_EQ(Detect(board, 2)[0].detections.size(), 2u);  // 6 and 8
  steps_ = {{0, 6}, {1, 7}, {2, 9}};
  const auto thinned = Detect(board, 2);
  EXPECT_FALSE(thinned[0].cached);
  EXPECT_EQ(thinned[0].detections.at(0).frame_idx, 6);
}

TEST_F(CachedFootage, DamagedEntriesAreMadeAnew) {
  WriteVideo("one");
  const auto first = Detect("charuco:7x6:120mm:90mm:4x4_250");
  const std::vector<std::string> entries = FilesMatching(folder_ / "cache/detections/*.detections");
  ASSERT_EQ(entries.size(), 1u);
  const std::string good = ReadFile(entries[0]);
  std::string flipped = good;
  flipped[good.size() / 2] ^= 1;
  for (const std::string& bad : {std::string(), good.substr(0, good.size() / 2), flipped, std::string(500, 'x')}) {
    WriteFileAtomic(entries[0], bad);
    const auto again = Detect("charuco:7x6:120mm:90mm:4x4_250");
    EXPECT_FALSE(again[0].cached);
    ExpectSame(first, again);
    EXPECT_EQ(ReadFile(entries[0]), good) << "rewritten";
  }
}

TEST_F(CachedFootage, AnUnwritableFolderCostsNothingButTime) {
  WriteVideo("one");
  std::ofstream(folder_ / "cache") << "a file where the folder should be";
  EXPECT_FALSE(Detect("charuco:7x6:120mm:90mm:4x4_250")[0].cached);
}

}  // namespace
}  // namespace mvstudio::calib
