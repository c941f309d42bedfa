#include <algorithm>
#include <fstream>
#include <sstream>

#include "calib/board/apriltag.h"
#include "calib/detect/board_check.h"
#include "calib/detect/detect_board.h"
#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "dataset/footage/frames.h"
#include "dataset/footage/image_io.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::calib {
namespace {

struct ExpectedTag {
  int id = 0;
  Eigen::Matrix<double, 2, 4> px;
};

/// Lines `id, (x y), (x y), (x y), (x y)` in the library's pixel origin.
std::vector<ExpectedTag> ReadExpected(const std::string& path) {
  std::vector<ExpectedTag> tags;
  std::ifstream in(path);
  for (std::string line; std::getline(in, line);) {
    std::replace_if(
        line.begin(), line.end(), [](char c) { return c == ',' || c == '(' || c == ')'; }, ' ');
    std::istringstream values(line);
    ExpectedTag tag;
    values >> tag.id;
    for (int k = 0; k < 4; ++k) values >> tag.px(0, k) >> tag.px(1, k);
    tag.px.array() -= 0.5;
    if (values) tags.push_back(tag);
  }
  return tags;
}

/// The expected corners are those of a later version of the library: 3.3.0 on its own JPEG decoder is up to 0.141 px away from
/// them, too. 180 of the 188 agree to 0.02 px, so origin and settings are the same.
TEST(AprilTagPhotos, AllTagsWhereTheLibraryPutsThem) {
  MVS_NEEDS_DATA("apriltag");
  int num_expected = 0, num_found = 0, num_corners_near = 0;
  double worst = 0;
  for (const std::string& path : FilesMatching(DataRoot() + "/apriltag/*.jpg")) {
    const std::vector<Tag> tags = FindTags(*FindTagFamily("36h11"), TagBorder::kNarrow, dataset::ReadImage(path, true));
    const auto expected_tags = ReadExpected(path.substr(0, path.size() - 4) + ".txt");
    EXPECT_EQ(tags.size(), expected_tags.size()) << path;
    for (const ExpectedTag& expected : expected_tags) {
      ++num_expected;
      double nearest = 1e9;
      Eigen::Matrix<double, 2, 4> error = Eigen::Matrix<double, 2, 4>::Zero();
      for (const Tag& tag : tags) {
        if (tag.id != expected.id || (tag.px - expected.px).norm() >= nearest) continue;
        nearest = (tag.px - expected.px).norm();
        error = tag.px - expected.px;
      }
      if (nearest > 1) continue;
      ++num_found;
      worst = std::max(worst, error.cwiseAbs().maxCoeff());
      num_corners_near += (error.cwiseAbs().colwise().maxCoeff().array() <= 0.1).count();
    }
  }
  EXPECT_EQ(num_expected, 47);
  EXPECT_EQ(num_found, 47);
  EXPECT_GE(num_corners_near, 185) << "of 188";
  EXPECT_LT(worst, 0.15);
}

TEST(CharucoPhotos, AllCorners) {
  MVS_NEEDS_DATA("opencv_omni_charuco");
  const Board board = ParseBoard("charuco:5x7:40mm:20mm:6x6_250");
  const int at_least[] = {24, 24, 22, 24};
  for (int i = 0; i < 4; ++i) {
    const Image image = dataset::ReadImage(DataRoot() + "/opencv_omni_charuco/img_0" + std::to_string(i) + ".jpg");
    const BoardDetection found = DetectBoard(board, image);
    ASSERT_EQ(found.status, Status::kOk) << found.reason;
    EXPECT_GE(found.detection.num_corners(), at_least[i]) << i;
    EXPECT_LT(found.sigma_px, 0.15);
  }
}

/// The board is inverted and has 4 x 5 squares; neither the colours nor which number is the columns' need be known.
TEST(CaliscopeVideos, WhichBoardIsIt) {
  MVS_NEEDS_DATA("caliscope");
  const auto source = dataset::OpenFrames(DataRoot() + "/caliscope/sessions/post_optimization/calibration/extrinsic/cam_0.mp4");
  std::vector<Image> images;
  for (int i = 0; auto frame = source->Next(); ++i) {
    if (i % 12 == 0) images.push_back(std::move(frame->rgb));
  }
  const BoardCheckReport report = CheckBoard(ParseBoard("charuco:5x4:54mm:40.5mm"), images, RunContext());
  ASSERT_TRUE(report.best.has_value());
  const BoardTrial& best = report.trials[*report.best];
  EXPECT_EQ(ToString(best.board), "charuco:4x5:54mm:40.5mm:4x4_1000:inverted") << best.relation;
  EXPECT_GE(2 * best.num_images, report.num_images);
}

}  // namespace
}  // namespace mvstudio::calib
