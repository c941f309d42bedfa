#include "calib/detect/detection_cache.h"

#include <sys/wait.h>
#include <unistd.h>

#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

StoredFootage Example(int images) {
  StoredFootage footage;
  footage.width_px = 640, footage.height_px = 480;
  for (int i = 0; i < images; ++i) {
    BoardDetection found, missing;
    for (const int id : {i, 7, 3}) found.detection.corner_ids.push_back(id);
    found.detection.points_px = Eigen::Matrix2Xd::Random(2, 3) * 1e3;
    found.detection.sigmas_px = Eigen::VectorXd::Random(3);
    found.num_found = 5, found.sigma_px = 0.1 / 3, found.legacy = true, found.num_markers = 4;
    missing.status = Status::kTooFewViews;
    missing.reason = "no marker of the board found";
    StoredFootage::DetectedImage image;
    image.frame_idx = int64_t{1} << (40 + i);
    missing.soft.push_back(found);
    image.layouts.push_back(found);
    image.layouts.push_back(missing);
    footage.images.push_back(image);
  }
  return footage;
}

void ExpectEqual(const StoredFootage& a, const StoredFootage& b) {
  EXPECT_EQ(a.width_px, b.width_px);
  ASSERT_EQ(a.images.size(), b.images.size());
  for (size_t i = 0; i < a.images.size(); ++i) {
    EXPECT_EQ(a.images[i].frame_idx, b.images[i].frame_idx);
    ASSERT_EQ(a.images[i].layouts.size(), b.images[i].layouts.size());
    for (size_t l = 0; l < a.images[i].layouts.size(); ++l) {
      const BoardDetection &x = a.images[i].layouts[l], &y = b.images[i].layouts[l];
      EXPECT_EQ(x.status, y.status);
      EXPECT_EQ(x.reason, y.reason);
      EXPECT_EQ(x.detection.corner_ids, y.detection.corner_ids);
      EXPECT_EQ(x.detection.points_px, y.detection.points_px);
      EXPECT_EQ(x.detection.sigmas_px, y.detection.sigmas_px);
      EXPECT_EQ(x.num_found, y.num_found);
      EXPECT_EQ(x.num_markers, y.num_markers);
      EXPECT_EQ(x.sigma_px, y.sigma_px);
      EXPECT_EQ(x.legacy, y.legacy);
      ASSERT_EQ(x.soft.size(), y.soft.size());
      if (x.soft.empty()) continue;
      EXPECT_EQ(x.soft[0].detection.points_px, y.soft[0].detection.points_px);
    }
  }
}

TEST(DetectionCache, RoundTripToTheLastBit) {
  const TempDir folder;
  const DetectionCache cache(CacheIn(folder.path()));
  EXPECT_FALSE(cache.Load("key").has_value());
  const StoredFootage footage = Example(5);
  cache.Store("key", footage);
  const auto loaded = cache.Load("key");
  ASSERT_TRUE(loaded.has_value());
  ExpectEqual(footage, *loaded);
}

TEST(DetectionCache, EveryFlippedByteIsNoticed) {
  const TempDir folder;
  const DetectionCache cache(CacheIn(folder.path()));
  cache.Store("key", Example(1));
  const std::string path = folder / "detections/key.detections", good = ReadFile(path);
  for (size_t i = 0; i < good.size(); i += 7) {
    std::string bad = good;
    bad[i] ^= 0x10;
    WriteFileAtomic(path, bad);
    EXPECT_FALSE(cache.Load("key").has_value()) << i;
  }
  for (size_t size = 0; size < good.size(); size += 31) {
    WriteFileAtomic(path, good.substr(0, size));
    EXPECT_FALSE(cache.Load("key").has_value()) << size;
  }
}

TEST(DetectionCache, TwoProcessesMayShareAFolder) {
  const TempDir folder;
  const DetectionCache cache(CacheIn(folder.path()));
  cache.Store("key", Example(3));
  const pid_t child = fork();
  bool good = true;
  for (int i = 0; i < 40; ++i) {
    cache.Store("key", Example(3));
    const auto loaded = cache.Load("key");
    good = good && loaded && loaded->images.size() == 3;
  }
  if (child == 0) _exit(good ? 0 : 1);
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_TRUE(good);
  EXPECT_EQ(status, 0);
}

TEST(ContentDigest, FollowsNamesAndContents) {
  const TempDir folder;
  EXPECT_FALSE(ContentDigest(folder / "*.png").has_value());
  WriteFileAtomic(folder / "a.png", "1");
  WriteFileAtomic(folder / "b.png", "2");
  const auto two = ContentDigest(folder / "*.png");
  ASSERT_TRUE(two.has_value());
  EXPECT_EQ(ContentDigest(folder.path()), two);
  WriteFileAtomic(folder / "b.png", "3");
  EXPECT_NE(ContentDigest(folder / "*.png"), two);
  WriteFileAtomic(folder / "b.png", "2");
  EXPECT_EQ(ContentDigest(folder / "*.png"), two);
  WriteFileAtomic(folder / "c.png", "4");
  EXPECT_NE(ContentDigest(folder / "*.png"), two);
  WriteFileAtomic(folder / "01_2.jpg", "5");
  EXPECT_NE(ContentDigest(folder / "*_2.jpg"), ContentDigest(folder / "01_*.jpg")) << "frame 1 or 2";
}

TEST(DetectionKey, DependsOnEverything) {
  const Board board = ParseBoard("chessboard:9x6:25mm"), other = ParseBoard("chessboard:9x6:26mm");
  DetectOptions options, exact;
  exact.detector = Detector::kExact;
  const std::string key = DetectionKey("d", board, options, 1);
  EXPECT_EQ(key, DetectionKey("d", board, options, 1));
  EXPECT_NE(key, DetectionKey("e", board, options, 1));
  EXPECT_NE(key, DetectionKey("d", other, options, 1));
  EXPECT_NE(key, DetectionKey("d", board, exact, 1));
  EXPECT_NE(key, DetectionKey("d", board, options, 2));
}

}  // namespace
}  // namespace mvstudio::calib
