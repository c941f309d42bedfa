#include <algorithm>
#include <utility>

#include "calib/board/charuco_layout.h"
#include "calib/detect/corner_search.h"
#include "calib/detect/detect_board.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

/// A large board close to a fisheye camera: no one homography holds over it.
class LargeBoard : public ::testing::Test {
 protected:
  LargeBoard() {
    camera_.width_px = 1120, camera_.height_px = 840;
    camera_.params.head<4>() << 330, 330, 560.3, 419.6;
    const Eigen::Vector3d centre = CornersInBoard(board_).rowwise().mean();
    pose_.rotation = geometry::RotationExp(Eigen::Vector3d(0.15, -0.2, 0.1));
    pose_.translation = Eigen::Vector3d(0.02, -0.01, 0.42) - pose_.rotation * centre;
  }

  /// Image of a position in squares from corner (0, 0).
  Eigen::Vector2d Px(double x, double y) const {
    const Eigen::Vector3d origin = CornersInBoard(board_).col(0);
    return geometry::Project(camera_, pose_ * Eigen::Vector3d(origin + board_.square_m * Eigen::Vector3d(x, y, 0))).px;
  }
  double OffPx(const Detection& found, int i) const {
    const int id = found.corner_ids[static_cast<size_t>(i)];
    return (Px(id % board_.cols, id / board_.cols) - found.points_px.col(i)).norm();
  }
  double LargestOffPx(const Detection& found) const {
    double largest = 0;
    for (int i = 0; i < found.num_corners(); ++i) largest = std::max(largest, OffPx(found, i));
    return largest;
  }
  /// Of corner (x, y) where (at_x, at_y) is.
  CornerGuess Guess(int x, int y, double at_x, double at_y) const {
    return {x + board_.cols * y, Px(at_x, at_y), Px(at_x + 0.5, at_y) - Px(at_x - 0.5, at_y),
            Px(at_x, at_y + 0.5) - Px(at_x, at_y - 0.5)};
  }
  FoundMarkers Markers() const {
    FoundMarkers found;
    const double half = board_.marker_m / (2 * board_.square_m);
    int id = 0;
    for (const Square& square : MarkerSquares(board_)) {
      const double x = square.col - 0.5, y = square.row - 0.5;
      Eigen::Matrix<double, 2, 4> px;
      px << Px(x - half, y - half), Px(x + half, y - half), Px(x + half, y + half), Px(x - half, y + half);
      found.px.emplace(id++, px);
    }
    return found;
  }

  Board board_ = ParseBoard("charuco:24x14:50mm:39mm:4x4_1000");
  geometry::Camera camera_ = MakeCamera("c", geometry::LensModel::kKannalaBrandt4, 330);
  geometry::Rigid3 pose_;
};

TEST_F(LargeBoard, IsFoundBehindAWideLens) {
  const BoardDetection found = DetectBoard(board_, RenderBoard(board_, camera_, pose_, 4));
  ASSERT_EQ(found.status, Status::kOk) << found.reason;
  EXPECT_GE(found.detection.num_corners(), board_.num_corners() * 9 / 10);
  EXPECT_LT(LargestOffPx(found.detection), 0.5);
}

TEST_F(LargeBoard, AllMarkersAgreeBehindAWideLens) {
  const MarkerSearch search = PlaceCorners(board_, Markers());
  EXPECT_EQ(search.num_markers, 24 * 14 / 2);
  EXPECT_EQ(search.num_agreeing, search.num_markers);
}

TEST_F(LargeBoard, WronglyNumberedMarkersDoNotAgree) {
  FoundMarkers markers = Markers();
  std::swap(markers.px.at(30), markers.px.at(31));   // beside each other
  std::swap(markers.px.at(70), markers.px.at(120));  // far away
  EXPECT_EQ(PlaceCorners(board_, markers).num_agreeing, 24 * 14 / 2 - 4);
}

TEST_F(LargeBoard, OfAnotherNumberOfColumnsIsRefused) {
  const Board claimed = ParseBoard("charuco:23x14:50mm:39mm:4x4_1000"),
              legacy = ParseBoard("charuco:24x14:50mm:39mm:4x4_1000:legacy");
  for (const Board& other : {claimed, legacy}) {
    const MarkerSearch search = PlaceCorners(other, Markers());
    EXPECT_GT(search.num_markers - search.num_agreeing, search.num_markers / 10) << ToString(other);
  }
}

TEST_F(LargeBoard, CornersOnWrongSquaresAreDropped) {
  const Image image = RenderBoard(board_, camera_, pose_, 4);
  std::vector<CornerGuess> one_wrong, jump;
  for (int y = 0; y < board_.rows; ++y) {
    for (int x = 0; x < board_.cols; ++x) {
      const bool wrong = (x == 20 && y == 2) || (x == 11 && y == 6);
      one_wrong.push_back(wrong ? Guess(x, y, x + 1, y + 1) : Guess(x, y, x, y));
      if (x < 14) jump.push_back(Guess(x, y, x, y));
      if (x >= 14 && x + 2 < board_.cols) jump.push_back(Guess(x, y, x + 2, y));  // corners of the same colours
    }
  }
  const BoardDetection found = LocateBoard(board_, image, one_wrong);
  ASSERT_EQ(found.status, Status::kOk) << found.reason;
  EXPECT_GE(found.detection.num_corners(), board_.num_corners() * 9 / 10);
  EXPECT_LT(LargestOffPx(found.detection), 0.5);
  const BoardDetection jumped = LocateBoard(board_, image, jump);
  if (jumped.status != Status::kOk) return;
  EXPECT_LT(LargestOffPx(jumped.detection), 0.5) << "the part behind the jump is left out";
}

}  // namespace
}  // namespace mvstudio::calib
