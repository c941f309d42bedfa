#include "calib/board/layout.h"
#include "tests/calib/synthetic.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

std::vector<Detection> Views(uint64_t seed) {
  testing::SceneOptions options;
  options.model = geometry::LensModel::kBrown2;
  options.seed = seed;
  testing::Scene scene = testing::MakeScene(options);
  testing::ObserveAll(&scene, 0.2, seed);
  return scene.detections;
}

Board Described(int cols, int rows) {
  testing::Scene scene = testing::MakeScene({});
  Board board = scene.board;
  board.cols = cols, board.rows = rows;
  return board;
}

TEST(BoardLayout, TheRightDescriptionIsNoFault) {
  const Board board = testing::MakeScene({}).board;
  EXPECT_FALSE(FindLayoutFault({board}, Views(1)));
}

TEST(BoardLayout, ExchangedColumnsAndRowsAreFound) {
  const Board board = testing::MakeScene({}).board;
  ASSERT_NE(board.cols, board.rows);
  const auto fault = FindLayoutFault({Described(board.rows, board.cols)}, Views(2));
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->cols, board.cols);
  EXPECT_EQ(fault->rows, board.rows);
  EXPECT_NE(ToString(*fault).find(std::to_string(board.cols) + " columns"), std::string::npos);
  EXPECT_EQ(fault->mended, ToString(board));
}

TEST(BoardLayout, AColumnTooManyIsFound) {
  const Board board = testing::MakeScene({}).board;
  const auto fault = FindLayoutFault({Described(board.cols + 1, board.rows)}, Views(3));
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->cols, board.cols);
}

TEST(BoardLayout, ScatteredCornersBelieveNothing) {
  const Board board = testing::MakeScene({}).board;
  std::vector<Detection> views = Views(4);
  Rng rng(4);
  for (Detection& d : views) {
    for (Eigen::Index i = 0; i < d.points_px.cols(); ++i) d.points_px.col(i) << 600 * rng.Uniform(), 400 * rng.Uniform();
  }
  EXPECT_FALSE(FindLayoutFault({board}, views));
}

TEST(BoardLayout, NothingIsSaidOfNothing) {
  EXPECT_FALSE(FindLayoutFault({}, {}));
  EXPECT_FALSE(FindLayoutFault({testing::MakeScene({}).board}, {}));
}

}  // namespace
}  // namespace mvstudio::calib
