#include "calib/corners/corner_files.h"

#include <cmath>
#include <set>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/random.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"
#include "tests/support/test_data.h"

namespace mvstudio::calib {
namespace {

Board Grid(int cols, int rows, double square_m) {
  Board board;
  board.kind = Board::Kind::kGrid;
  board.cols = cols, board.rows = rows, board.square_m = square_m;
  return board;
}

CornerFileOptions WithBoard(const Board& board) {
  CornerFileOptions options;
  options.board = board;
  return options;
}

std::string Write(const TempDir& folder, const std::string& name, const std::string& text) {
  WriteFileAtomic(folder / name, text);
  return folder / name;
}

std::string Contains(const std::string& text, const std::string& piece) {
  return text.find(piece) != std::string::npos ? "" : "'" + piece + "' is not in: " + text;
}

#define EXPECT_SAYS(text, piece) EXPECT_EQ(Contains(text, piece), "")

/// A 2x2 board, two cameras, three frames, one corner not found, one of a coarser level.
constexpr char kVnl[] =
    "# filename x y level\n"
    "cam1-0003.jpg 10 20 0\ncam1-0003.jpg 30 20 1\ncam1-0003.jpg 10 40 -\ncam1-0003.jpg 30 40 0\n"
    "cam0-0003.jpg 11 20 0\ncam0-0003.jpg 31 20 0\ncam0-0003.jpg 11 40 0\ncam0-0003.jpg 31 40 0\n"
    "cam0-0004.jpg - - -\n";

TEST(CornerFiles, OneThatIsPackedIsNamed) {
  TempDir folder;
  const std::string path = Write(folder, "corners.csv.gz", "\x1f\x8b\x08 packed");
  EXPECT_SAYS(MessageOf<FormatError>([&] { ReadCornerFile(path); }),
              "it looks like a file that gzip packed (gunzip unpacks it)");
}

TEST(Vnl, LevelsBecomeSigmasAndMissingCornersAreSkipped) {
  TempDir folder;
  const CornerFile file = ReadCornerFile(Write(folder, "a.vnl", kVnl), WithBoard(Grid(2, 2, 0.1)));
  ASSERT_EQ(file.cameras.size(), 2u);
  EXPECT_EQ(file.cameras[0].name, "cam1");
  EXPECT_EQ(file.cameras[0].width_px, 0);
  ASSERT_EQ(file.detections.size(), 2u);
  const Detection& first = file.detections[0];
  EXPECT_EQ(first.frame_idx, 3);
  EXPECT_EQ(first.corner_ids, (std::vector<int>{0, 1, 3}));
  EXPECT_EQ(first.points_px.col(2), Eigen::Vector2d(30, 40));
  ASSERT_EQ(first.sigmas_px.size(), 3);
  EXPECT_EQ(first.sigmas_px[0], 1);
  EXPECT_EQ(first.sigmas_px[1], 2);
  EXPECT_EQ(file.detections[1].sigmas_px.size(), 0);
  EXPECT_EQ(file.detections[1].sigma_px, 1);
}

TEST(Vnl, PlaceholdersAreNotFound) {
  TempDir folder;
  const CornerFile file = ReadCornerFile(Write(folder, "a.vnl",
                                               "# filename x y level\n"
                                               "c-1.jpg 0 0 0\nc-1.jpg 30 20 1\nc-1.jpg 10 40 0\nc-1.jpg 30 40 0\n"
                                               "c-2.jpg 7 8 0\nc-2.jpg 7 8 0\nc-2.jpg 10 40 0\nc-2.jpg 30 40 0\n"
                                               "c-3.jpg 0 0 0\nc-3.jpg 0 0 0\nc-3.jpg 0 0 0\nc-3.jpg 0 0 0\n"),
                                         WithBoard(Grid(2, 2, 0.1)));
  ASSERT_EQ(file.detections.size(), 2u);
  EXPECT_EQ(file.detections[0].corner_ids, (std::vector<int>{1, 2, 3}));
  EXPECT_EQ(file.detections[0].sigmas_px[0], 2);
  EXPECT_EQ(file.detections[1].corner_ids, (std::vector<int>{2, 3}));
  ASSERT_EQ(file.notes.size(), 1u);
  EXPECT_EQ(file.notes[0].code, "CAL-PLACEHOLDER");
  EXPECT_SAYS(file.notes[0].text, "7 corners");
}

TEST(Vnl, WeightsAreInverseSigmas) {
  TempDir folder;
  const std::string path = Write(folder, "a.vnl",
                                 "# filename x y weight\nl/7.png 1 1 0.5\nl/7.png 2 1 0\nl/7.png 1 2 1\nl/7.png 2 2 1\n"
                                 "r/7.png 1 1 1\nr/7.png 2 1 1\nr/7.png 1 2 1\nr/7.png 2 2 1\n");
  const CornerFile file = ReadCornerFile(path, WithBoard(Grid(2, 2, 0.1)));
  ASSERT_EQ(file.detections.size(), 2u);
  EXPECT_EQ(file.cameras[1].name, "r");
  EXPECT_EQ(file.detections[0].corner_ids, (std::vector<int>{0, 2, 3}));
  EXPECT_EQ(file.detections[0].sigmas_px[0], 2);
  EXPECT_EQ(file.detections[1].frame_idx, 7);
}

TEST(Vnl, CameraAndFrameFromNames) {
  struct Case {
    const char *name, *camera;
    int64_t frame;
  };
  for (const Case& c :
       {Case{"cam0-0000.jpg", "cam0", 0}, Case{"frame12-cam3.png", "cam3", 12}, Case{"left/0031.png", "left", 31},
        Case{"x/left_07.png", "left", 7}, Case{"0012/camera_2.png", "camera_2", 12}, Case{"5.jpg", "camera", 5}}) {
    TempDir folder;
    const std::string name = c.name;
    const std::string text = name + " 1 1\n" + name + " 2 1\n" + name + " 1 2\n" + name + " 2 2\n";
    const CornerFile file = ReadCornerFile(Write(folder, "a.vnl", text), WithBoard(Grid(2, 2, 0.1)));
    ASSERT_EQ(file.detections.size(), 1u) << name;
    EXPECT_EQ(file.cameras[0].name, c.camera);
    EXPECT_EQ(file.detections[0].frame_idx, c.frame);
  }
}

TEST(Vnl, PatternsNameTheCameras) {
  TempDir folder;
  std::string text;
  for (const char* name : {"/a/shot5L.png", "/a/shot5R.png", "/a/other1.png"}) {
    for (const char* xy : {" 1 1 0\n", " 2 1 0\n", " 1 2 0\n", " 2 2 0\n"}) text += std::string(name) + xy;
  }
  CornerFileOptions options = WithBoard(Grid(2, 2, 0.1));
  options.cameras = {{"right", "shot", "R.png"}, {"left", "/a/shot", "L.png"}};
  options.sizes = {{"", 640, 480}, {"right", 640, 480}};
  const CornerFile file = ReadCornerFile(Write(folder, "a.vnl", text), options);
  ASSERT_EQ(file.detections.size(), 2u);
  EXPECT_EQ(file.cameras[0].name, "right");
  EXPECT_EQ(file.cameras[1].width_px, 640);
  EXPECT_EQ(file.detections[1].frame_idx, 5);
  ASSERT_EQ(file.notes.size(), 1u);
  EXPECT_EQ(file.notes[0].code, "CAL-IGNORED");
}

TEST(Vnl, SaysWhatIsWrong) {
  TempDir folder;
  const auto read = [&](const std::string& text, const CornerFileOptions& options) {
    return MessageOf<Error>([&] { ReadCornerFile(Write(folder, "a.vnl", text), options); });
  };
  const CornerFileOptions two = WithBoard(Grid(2, 2, 0.1));
  EXPECT_SAYS(read(kVnl, {}), "give option 'board'");
  EXPECT_SAYS(read(kVnl, WithBoard(Grid(3, 3, 0.1))), "has 4 corners, the board 9");
  EXPECT_SAYS(read("# filename x y level\ncam0-1.jpg 1 nan 0\n", WithBoard(Grid(1, 1, 0.1))), "line 2");
  EXPECT_SAYS(read("# filename x y level\ncam0-1.jpg 1 2\n", two), "3 columns");
  EXPECT_SAYS(read("# filename x y level\n", two), "no corner in it");
  EXPECT_SAYS(read("", two), "empty");
  EXPECT_SAYS(read("board.jpg 1 1\nboard.jpg 1 1\nboard.jpg 1 1\nboard.jpg 1 1\n", two), "option 'corners-camera'");
  EXPECT_SAYS(read("a1.jpg 1 1\nb1.jpg 1 1\na1.jpg 1 1\n", two), "not together");
  CornerFileOptions bad = two;
  bad.sizes = {{"cam7", 640, 480}};
  EXPECT_SAYS(read(kVnl, bad), "no camera 'cam7'");
}

TEST(CornerFileOptions, AreReadFromTheirWords) {
  CornerFileOptions options;
  FromString("left=a/left*.jpg", &options.cameras.emplace_back());
  EXPECT_EQ(options.cameras[0].camera, "left");
  EXPECT_EQ(options.cameras[0].prefix, "a/left");
  EXPECT_EQ(options.cameras[0].suffix, ".jpg");
  EXPECT_EQ(ToString(options.cameras[0]), "left=a/left*.jpg");
  for (const char* text : {"left", "=*.jpg", "left=a.jpg", "left=*a*.jpg", "l*=a.jpg"})
    EXPECT_THROW(FromString(text, &options.cameras[0]), UsageError) << text;
  for (const char* text : {"640x480", "cam7=640x480", "a=b=1x2"}) {
    FromString(text, &options.sizes.emplace_back());
    EXPECT_EQ(ToString(options.sizes.back()), text);
  }
  EXPECT_SAYS(MessageOf<UsageError>([&] { FromString("640*480", &options.sizes[0]); }), "WIDTHxHEIGHT");
  EXPECT_SAYS(MessageOf<UsageError>([&] { FromString("furlong", "corners-unit", &options.unit); }), "m, cm, mm or in");
  EXPECT_THROW(FromString("xml", &options.format), UsageError);
}

constexpr char kCaliscope[] =
    "sync_index,port,frame_index,point_id,img_loc_x,img_loc_y,obj_loc_x,obj_loc_y\n"
    "9,1,4,0,10,10,0.05,0.05\n9,1,4,1,20,10,0.10,0.05\n9,1,4,2,10,20,0.05,0.10\n9,1,4,3,20,20,0.10,0.10\n"
    "9,0,9,0,12,10,0.05,0.05\n9,0,9,3,22,20,0.10,0.10\n";

TEST(Caliscope, TimeStepsAreSyncIndices) {
  TempDir folder;
  const CornerFile file = ReadCornerFile(Write(folder, "xy.csv", kCaliscope));
  ASSERT_EQ(file.cameras.size(), 2u);
  EXPECT_EQ(file.cameras[0].name, "cam_0");
  ASSERT_EQ(file.boards.size(), 1u);
  EXPECT_EQ(file.boards[0].kind, Board::Kind::kGrid);
  EXPECT_EQ(file.boards[0].cols, 2);
  EXPECT_EQ(file.boards[0].square_m, 0.05);
  ASSERT_EQ(file.detections.size(), 2u);
  EXPECT_EQ(file.detections[0].frame_idx, 9);
  EXPECT_EQ(file.detections[1].frame_idx, 9);
  EXPECT_EQ(file.detections[0].corner_ids, (std::vector<int>{0, 3}));
}

TEST(Caliscope, RefusesFramesThatAreNotTimeSteps) {
  TempDir folder;
  const auto read = [&](std::string text) {
    return MessageOf<FormatError>([&] { ReadCornerFile(Write(folder, "xy.csv", text)); });
  };
  std::string text = kCaliscope;
  text.replace(0, 10, "other_name");
  EXPECT_SAYS(read(text), "caliscope pairs frames by sync_index");
  EXPECT_SAYS(read(std::string(kCaliscope) + "9,0,10,1,1,1,0.10,0.05\n"), "already has frame 9");
  EXPECT_SAYS(read(std::string(kCaliscope) + "10,0,8,1,1,1,0.10,0.05\n"), "backwards in time");
  EXPECT_SAYS(read(std::string(kCaliscope) + "9,0,9,3,1,1,0.10,0.10\n"), "given twice");
  EXPECT_SAYS(read(std::string(kCaliscope) + "9,0,9,1,1,1,0.11,0.05\n"), "elsewhere on the board");
  EXPECT_SAYS(read(std::string(kCaliscope) + "9,0,9,1,1,1\n"), "6 columns");
}

TEST(Caliscope, OneCameraNeedsNoSyncIndex) {
  TempDir folder;
  const std::string text =
      "frame_index,cam_id,keypoint_id,img_loc_x,img_loc_y,obj_loc_x,obj_loc_y\n3,5,0,1,1,0,0\n3,5,1,2,1,1,0\n4,5,0,1,1,0,0\n";
  const CornerFile file = ReadCornerFile(Write(folder, "xy.csv", text));
  ASSERT_EQ(file.detections.size(), 2u);
  EXPECT_EQ(file.cameras[0].name, "cam_5");
  EXPECT_EQ(file.detections[1].frame_idx, 4);
}

TEST(Caliscope, RealSession) {
  MVS_NEEDS_DATA("caliscope");
  const CornerFile file = ReadCornerFile(DataRoot() + "/caliscope/sessions/post_optimization/calibration/extrinsic/xy.csv");
  ASSERT_EQ(file.cameras.size(), 4u);
  EXPECT_EQ(file.cameras[3].width_px, 1280);
  EXPECT_EQ(file.cameras[3].height_px, 720);
  ASSERT_EQ(file.boards.size(), 1u);
  EXPECT_EQ(file.boards[0].kind, Board::Kind::kGrid);
  EXPECT_EQ(file.boards[0].cols, 3);
  EXPECT_EQ(file.boards[0].rows, 4);
  EXPECT_EQ(file.boards[0].square_m, 0.054);
  int corners = 0;
  std::set<int64_t> time_steps;
  for (const Detection& detection : file.detections) {
    corners += detection.num_corners();
    time_steps.insert(detection.frame_idx);
    EXPECT_GE(ViewOrientation(file.boards[0], detection), 0);
  }
  EXPECT_EQ(corners, 2199);
  EXPECT_EQ(*time_steps.begin(), 35);
  ASSERT_EQ(file.notes.size(), 1u);
  EXPECT_EQ(file.notes[0].code, "CAL-SIZES");
}

TEST(OpenCvXml, OmniMonoAndStereo) {
  MVS_NEEDS_DATA("opencv_omni_charuco");
  const CornerFile mono = ReadCornerFile(DataRoot() + "/opencv_omni_charuco/omni_calib_data.xml");
  ASSERT_EQ(mono.cameras.size(), 1u);
  EXPECT_EQ(mono.cameras[0].width_px, 1280);
  EXPECT_EQ(mono.cameras[0].height_px, 960);
  ASSERT_EQ(mono.detections.size(), 15u);
  EXPECT_EQ(mono.boards[0].cols, 6);
  EXPECT_EQ(mono.boards[0].rows, 9);
  EXPECT_EQ(mono.boards[0].square_m, 0.2);
  EXPECT_EQ(mono.detections[14].points_px.col(53), Eigen::Vector2d(920.939758, 570.050781));
  CornerFileOptions options;
  options.unit = LengthUnit::kMillimetre;
  const CornerFile stereo = ReadCornerFile(DataRoot() + "/opencv_omni_charuco/omni_stereocalib_data.xml", options);
  ASSERT_EQ(stereo.cameras.size(), 2u);
  EXPECT_EQ(stereo.cameras[1].name, "right");
  EXPECT_EQ(stereo.cameras[1].height_px, 576);
  ASSERT_EQ(stereo.detections.size(), 78u);
  EXPECT_EQ(stereo.detections[0].num_corners(), 48);
  EXPECT_EQ(stereo.detections[0].points_px.col(0), Eigen::Vector2d(283.72964477539062, 95.561058044433594));
  EXPECT_EQ(stereo.boards[0].square_m, 0.08);
}

std::string Matrix(int channels, const std::string& numbers, int n) {
  return "<_ type_id=\"opencv-matrix\"><rows>" + std::to_string(n) + "</rows><cols>1</cols><dt>\"" + std::to_string(channels) +
         "d\"</dt><data>" + numbers + "</data></_>";
}

TEST(OpenCvXml, SubsetsOfIrregularPointsAndTruncation) {
  TempDir folder;
  const std::string points = "<opencv_storage><objectPoints>" + Matrix(3, "0 0 0 1 0 0 0 2 0", 3) +
                             Matrix(3, "0 2 0 5 5 1", 2) + "</objectPoints><imagePoints>";
  const std::string images = Matrix(2, "1 1 2 1 1 3", 3) + Matrix(2, "9 8 7 6", 2) + "</imagePoints></opencv_storage>";
  CornerFileOptions options;
  options.unit = LengthUnit::kCentimetre;
  const CornerFile file = ReadCornerFile(Write(folder, "a.xml", points + images), options);
  EXPECT_EQ(file.boards[0].kind, Board::Kind::kPoints);
  ASSERT_EQ(file.boards[0].points.cols(), 4);
  EXPECT_NEAR(file.boards[0].points(2, 3), 0.01, 1e-17);
  ASSERT_EQ(file.detections.size(), 2u);
  EXPECT_EQ(file.detections[1].corner_ids, (std::vector<int>{2, 3}));
  const auto read = [&](const std::string& text) {
    return MessageOf<Error>([&] { ReadCornerFile(Write(folder, "a.xml", text)); });
  };
  EXPECT_SAYS(read(points + Matrix(2, "1 1 2 1 1 3", 3) + "</imagePoints></opencv_storage>"), "imagePoints: 1 views");
  EXPECT_SAYS(read(points + Matrix(2, "1 1 2 1 1", 3) + "</imagePoints></opencv_storage>"), "5 numbers");
  EXPECT_SAYS(read((points + images).substr(0, 300)), "is not closed");
}

TEST(CornerCsv, RoundTripIsExact) {
  TempDir folder;
  Rng rng(3);
  CornerFile file;
  file.cameras = {{"left", 640, 480}, {"the, \"right\" one", 0, 0}};
  file.boards = {ParseBoard("chessboard:3x2:25mm"), Board()};
  file.boards[1].kind = Board::Kind::kPoints;
  file.boards[1].points = Eigen::Matrix3Xd::NullaryExpr(3, 5, [&] { return rng.Normal(); });
  for (int i = 0; i < 6; ++i) {
    Detection detection;
    detection.camera_idx = i / 3;
    detection.frame_idx = 100 + i % 3;
    detection.board_idx = i % 2;
    detection.corner_ids = {0, 2, 4};
    detection.points_px = Eigen::Matrix2Xd::NullaryExpr(2, 3, [&] { return 300 * rng.Normal(); });
    if (i == 2) detection.sigmas_px = Eigen::Vector3d(0.5, 1.0 / 3, 1);
    file.detections.push_back(detection);
  }
  WriteCornerFile(file, folder / "corners.csv");
  const CornerFile back = ReadCornerFile(folder / "corners.csv");
  ASSERT_EQ(back.cameras.size(), 2u);
  EXPECT_EQ(back.cameras[1].name, file.cameras[1].name);
  EXPECT_EQ(back.cameras[0].height_px, 480);
  ASSERT_EQ(back.boards.size(), 2u);
  EXPECT_EQ(ToString(back.boards[0]), ToString(file.boards[0]));
  EXPECT_EQ(back.boards[1].points, file.boards[1].points);
  ASSERT_EQ(back.detections.size(), file.detections.size());
  for (size_t i = 0; i < file.detections.size(); ++i) {
    EXPECT_EQ(back.detections[i].points_px, file.detections[i].points_px);
    EXPECT_EQ(back.detections[i].corner_ids, file.detections[i].corner_ids);
    EXPECT_EQ(back.detections[i].frame_idx, file.detections[i].frame_idx);
    EXPECT_EQ(back.detections[i].board_idx, file.detections[i].board_idx);
  }
  EXPECT_EQ(back.detections[2].sigmas_px, file.detections[2].sigmas_px);
}

/// A file that says where its corners lie, beside a board that was given.
TEST(StatedBoard, IsHeldAgainstTheBoardThatIsGiven) {
  TempDir folder;
  const std::string header = "<opencv_storage><objectPoints>", middle = "</objectPoints><imagePoints>";
  std::string places, pixels;
  for (int i = 0; i < 12; ++i) {
    places += std::to_string(i % 4 * 25) + " " + std::to_string(i / 4 * 25) + " 0 ";
    pixels += std::to_string(100 + i % 4 * 20) + " " + std::to_string(100 + i / 4 * 20) + " ";
  }
  const std::string xml = Write(
      folder, "a.xml", header + Matrix(3, places, 12) + middle + Matrix(2, pixels, 12) + "</imagePoints></opencv_storage>");
  CornerFile own;
  own.cameras = {{"a", 640, 480}};
  own.boards = {Grid(4, 3, 0.025)};
  own.detections = {{}};
  own.detections[0].corner_ids = {0, 5, 11};
  own.detections[0].points_px = Eigen::Matrix2Xd::Random(2, 3);
  WriteCornerFile(own, folder / "own.csv");
  for (const std::string& path : {xml, folder / "own.csv"}) {
    CornerFileOptions same = WithBoard(Grid(4, 3, 0.025)), larger = WithBoard(Grid(4, 3, 0.030)),
                      rotated = WithBoard(Grid(3, 4, 0.025));
    same.unit = larger.unit = rotated.unit = LengthUnit::kMillimetre;
    EXPECT_TRUE(ReadCornerFile(path, same).notes.empty()) << path;
    const std::vector<Notice> notes = ReadCornerFile(path, larger).notes;
    ASSERT_EQ(notes.size(), 1u) << path;
    EXPECT_EQ(notes[0].code, "CAL-BOARD-SIZE");
    EXPECT_SAYS(notes[0].text, "0.8333 times");
    EXPECT_SAYS(MessageOf<FormatError>([&] { ReadCornerFile(path, rotated); }), "other rows and columns");
  }
  std::string text = ReadFile(folder / "own.csv");
  text.replace(text.find("corners 1"), 9, "corners 2");
  EXPECT_SAYS(MessageOf<FormatError>([&] { ReadCornerFile(Write(folder, "two.csv", text)); }), "expected 'mvstudio corners 1'");
}

TEST(CornerCsv, SaysWhatIsWrong) {
  TempDir folder;
  const auto read = [&](const std::string& text) {
    return MessageOf<Error>([&] { ReadCornerFile(Write(folder, "a.csv", text)); });
  };
  const std::string header = "# board 0 chessboard:3x2:25mm\ncamera,frame,board,corner,x_px,y_px\n";
  EXPECT_SAYS(read("camera,frame,corner,x_px,y_px\na,1,0,1,1\n"), "give option 'board'");
  EXPECT_SAYS(read(header + "a,1,1,0,1,1\n"), "there are 1 boards");
  EXPECT_SAYS(read(header + "a,1,0,6,1,1\n"), "corner 6 is not on the board");
  EXPECT_SAYS(read(header + "a,1,0,0,1,inf\n"), "line 3, y_px");
  EXPECT_SAYS(read(header + "a,1.5,0,0,1,1\n"), "not a whole number");
  EXPECT_SAYS(read(header + "a,-1,0,0,1,1\n"), "counted from 0");
  EXPECT_SAYS(read(header + "a,9007199254740993,0,0,1,1\n"), "too large");
  EXPECT_SAYS(read("# board 1 chessboard:3x2:25mm\ncamera,frame,corner,x_px,y_px\n"), "numbered from 0");
  EXPECT_SAYS(read("# board 0 chessboard:3x:25mm\ncamera,frame,corner,x_px,y_px\n"), "line 1");
  EXPECT_SAYS(read("# camera 640 left\n" + header), "line 1");
  EXPECT_SAYS(read("camera,frame,x_px\n"), "no column 'corner'");
}

/// A board in front of a camera as an affine map sees it; the second camera mirrors its images when asked.
CornerFile MirroredFile(const TempDir& folder, bool first, bool second) {
  CornerFile file;
  file.cameras = {{"a", 640, 480}, {"b", 640, 480}};
  file.boards = {ParseBoard("chessboard:4x3:25mm")};
  for (int i = 0; i < 12; ++i) {
    Detection detection;
    detection.camera_idx = i % 2;
    detection.frame_idx = i / 2;
    detection.points_px.resize(2, 12);
    for (int corner = 0; corner < 12; ++corner) {
      detection.corner_ids.push_back(corner);
      const double sign = (i % 2 ? second : first) ? -1 : 1;
      detection.points_px.col(corner) << 320 + sign * 20 * (corner % 4) + i, 200 + 21 * (corner / 4) - corner % 4;
    }
    file.detections.push_back(detection);
  }
  WriteCornerFile(file, folder / "m.csv");
  return ReadCornerFile(folder / "m.csv");
}

TEST(Mirrored, BoardIsRenumbered) {
  TempDir folder;
  const CornerFile straight = MirroredFile(folder, false, false);
  EXPECT_TRUE(straight.notes.empty());
  const CornerFile file = MirroredFile(folder, true, true);
  ASSERT_EQ(file.notes.size(), 1u);
  EXPECT_EQ(file.notes[0].code, "CAL-MIRRORED");
  for (const Detection& detection : file.detections) EXPECT_EQ(ViewOrientation(file.boards[0], detection), 1);
  EXPECT_EQ(file.detections[0].corner_ids, straight.detections[0].corner_ids);
  EXPECT_EQ(file.detections[0].points_px(0, 0), 320 - 60);
}

TEST(Mirrored, CameraIsNamed) {
  TempDir folder;
  const CornerFile file = MirroredFile(folder, false, true);
  ASSERT_EQ(file.notes.size(), 1u);
  EXPECT_EQ(file.notes[0].code, "CAL-MIRRORED-CAMERA");
  EXPECT_SAYS(file.notes[0].text, "camera b sees the board mirrored in 6 of 6 views");
}

TEST(BoardFromPoints, GridsAndOthers) {
  Eigen::Matrix3Xd points = CornersInBoard(Grid(4, 3, 0.03));
  points.colwise() += Eigen::Vector3d(0.03, 0.03, 0);
  const Board grid = BoardFromPoints(points);
  EXPECT_EQ(grid.kind, Board::Kind::kGrid);
  EXPECT_EQ(grid.cols, 4);
  EXPECT_EQ(grid.square_m, 0.03);
  points(0, 5) += 1e-3;
  EXPECT_EQ(BoardFromPoints(points).kind, Board::Kind::kPoints);
}

TEST(Figueroa, AllCornersWithLevels) {
  MVS_NEEDS_DATA("mrcal_figueroa");
  CornerFileOptions options = WithBoard(Grid(10, 10, 0.077));
  options.sizes = {{"", 6016, 4016}};
  const CornerFile file = ReadCornerFile(DataRoot() + "/mrcal_figueroa/corners-cam0.vnl", options);
  ASSERT_EQ(file.cameras.size(), 1u);
  EXPECT_EQ(file.cameras[0].name, "cam0");
  EXPECT_EQ(file.cameras[0].width_px, 6016);
  ASSERT_EQ(file.detections.size(), 186u);
  int corners = 0, coarse = 0;
  for (const Detection& detection : file.detections) {
    corners += detection.num_corners();
    coarse += detection.sigmas_px.size() > 0 ? static_cast<int>((detection.sigmas_px.array() > 1).count()) : 0;
  }
  EXPECT_EQ(corners, 18600);
  EXPECT_NEAR(coarse / 18600.0, 0.15, 0.01);
  EXPECT_EQ(file.detections[0].points_px.col(6), Eigen::Vector2d(4868.837650, 130.331175));
  EXPECT_EQ(file.detections[0].sigmas_px[6], 2);
  EXPECT_TRUE(file.notes.empty());
}

}  // namespace
}  // namespace mvstudio::calib
