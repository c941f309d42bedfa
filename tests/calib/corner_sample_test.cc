#include "calib/corners/corner_files.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

std::string SampleFile(const std::string& board, const std::string& data) {
  return "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\n" + board +
         "image_points: !!opencv-matrix\n   rows: 2\n   cols: 6\n   dt: \"2f\"\n   data: [" + data + "]\n";
}

/// Two views of 3 x 2 corners that lie 20 px apart, the second view 5 px lower.
std::string SampleCorners() {
  std::string data;
  for (int i = 0; i < 12; ++i)
    data += (i ? ", " : "") + std::to_string(100 + 20 * (i % 3)) + ", " + std::to_string(50 + 20 * (i % 6 / 3) + 5 * (i / 6));
  return data;
}

TEST(OpenCvSample, ImagePointsRowByRow) {
  const TempDir folder;
  const std::string path = folder / "out.yml", board = "board_width: 3\nboard_height: 2\nsquare_size: 25.\n";
  const auto read = [&](const std::string& text, const CornerFileOptions& options = {}) {
    WriteFileAtomic(path, text);
    return ReadCornerFile(path, options);
  };
  CornerFileOptions millimetres;
  millimetres.unit = LengthUnit::kMillimetre;
  const CornerFile file = read(SampleFile(board, SampleCorners()), millimetres);
  ASSERT_EQ(file.detections.size(), 2u);
  EXPECT_EQ(ToString(file.boards[0]), "grid:3x2:25mm");
  EXPECT_EQ(file.cameras[0].width_px, 640);
  EXPECT_EQ(file.detections[1].frame_idx, 1);
  EXPECT_EQ(file.detections[1].points_px.col(4), Eigen::Vector2d(120, 75));
  CornerFileOptions given;
  given.board = ParseBoard("chessboard:3x2:30mm");
  EXPECT_EQ(ToString(read(SampleFile("", SampleCorners()), given).boards[0]), "chessboard:3x2:30mm");
  EXPECT_NE(MessageOf<UsageError>([&] { read(SampleFile("", SampleCorners())); }).find("option 'board'"), std::string::npos);
  EXPECT_NE(MessageOf<FormatError>([&] { read(SampleFile(board, "1, 2, 3")); }).find("3 numbers"), std::string::npos);
  given.board = ParseBoard("chessboard:4x2:30mm");
  EXPECT_NE(MessageOf<FormatError>([&] { read(SampleFile("", SampleCorners()), given); }).find("has 8"), std::string::npos);
}

/// Tables of others are refused with the header that is read.
TEST(CornerFiles, OfOtherProgramsAreNamed) {
  const TempDir folder;
  const auto refused = [&](const std::string& text) {
    WriteFileAtomic(folder / "corners.txt", text);
    return MessageOf<FormatError>([&] { ReadCornerFile(folder / "corners.txt", {}); });
  };
  EXPECT_NE(refused("filename: ./img.png\nwidth: 640\nnum_corners: 54\nencoding: ascii\n").find("deltille"), std::string::npos);
  EXPECT_NE(refused("image,row,col,x,y\na.png,0,0,1,2\n").find("camera,frame,corner,x_px,y_px"), std::string::npos);
}

}  // namespace
}  // namespace mvstudio::calib
