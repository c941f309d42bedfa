#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "calib/board/draw.h"
#include "calib/board/print.h"
#include "calib/detect/detect_board.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "tests/support/message_of.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

namespace mvstudio::calib {
namespace {

constexpr const char* kBoards[] = {
    "chessboard:6x4:25mm",    "charuco:7x5:25mm:18mm:4x4_50",         "charuco:7x5:25mm:18mm:4x4_50:inverted",
    "aprilgrid:5x6:25mm:0.3", "aprilgrid:3x4:25mm:0.8:Standard41h12", "tag:36h11:7:100mm",
    "tag:Circle21h7:7:70mm"};

double Area(const std::vector<BoardPage::Rect>& rects) {
  double area = 0;
  for (const auto& r : rects) area += r.width * r.height;
  return area;
}

/// All rectangles of the one path of a PDF page, millimetres, from the top left; checks the matrix on the way.
std::vector<BoardPage::Rect> RectsOfPdf(const std::string& pdf, double height_mm) {
  const size_t start = pdf.find("stream\nq\n") + 9;
  double a = 0, d = 0, f = 0;
  EXPECT_EQ(std::sscanf(pdf.c_str() + start, "%lf 0 0 %lf 0 %lf cm", &a, &d, &f), 3);
  EXPECT_NEAR(a, 72 / 25.4, 1e-8);
  EXPECT_NEAR(d, -72 / 25.4, 1e-8);
  EXPECT_NEAR(f, height_mm * 72 / 25.4, 1e-5);
  std::vector<BoardPage::Rect> rects;
  size_t line = pdf.find('\n', start) + 1;
  for (BoardPage::Rect r; std::sscanf(pdf.c_str() + line, "%lf %lf %lf %lf re", &r.x, &r.y, &r.width, &r.height) == 4;) {
    rects.push_back(r);
    line = pdf.find('\n', line) + 1;
  }
  return rects;
}

std::vector<BoardPage::Rect> RectsOfSvg(const std::string& svg) {
  std::vector<BoardPage::Rect> rects;
  for (size_t at = svg.find('M'); at != std::string::npos; at = svg.find('M', at + 1)) {
    BoardPage::Rect r;
    double back = 0;
    if (std::sscanf(svg.c_str() + at, "M%lf %lfh%lfv%lfh%lfz", &r.x, &r.y, &r.width, &r.height, &back) != 5) continue;
    EXPECT_NEAR(back, -r.width, 1e-9);
    rects.push_back(r);
  }
  return rects;
}

void ExpectSame(const std::vector<BoardPage::Rect>& a, const std::vector<BoardPage::Rect>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_NEAR(a[i].x, b[i].x, 1e-5);
    EXPECT_NEAR(a[i].y, b[i].y, 1e-5);
    EXPECT_NEAR(a[i].width, b[i].width, 1e-5);
    EXPECT_NEAR(a[i].height, b[i].height, 1e-5);
  }
}

TEST(LayOutBoard, TrueScaleWithinTheMargins) {
  for (const char* text : kBoards) {
    const Board board = ParseBoard(text);
    const BoardPrint print = PrintOf(board);
    const BoardPage page = LayOutBoard(board, {});
    double area = 0;
    for (const PrintRect& r : print.black) area += 1e6 * (r.high - r.low).prod();
    const std::vector<BoardPage::Rect> board_rects(page.rects.begin(), page.rects.begin() + print.black.size());
    EXPECT_NEAR(Area(board_rects), area, 1e-6 * area) << text;
    for (const auto& r : page.rects) {
      EXPECT_GE(std::min(r.x, r.y), 5) << text;
      EXPECT_LE(r.x + r.width, page.width - 5) << text;
      EXPECT_LE(r.y + r.height, page.height - 5) << text;
    }
    const auto& ruler = page.rects[print.black.size()];
    EXPECT_NEAR(ruler.width, 100.2, 1e-9) << "from the middle of the first tick to that of the last";
    const auto &first = page.rects[print.black.size() + 1], &last = page.rects.back();
    EXPECT_NEAR(last.x - first.x, 100, 1e-9);
    EXPECT_GT(ruler.y, page.board_y + 1e3 * (print.high_m - print.low_m).y()) << "below the board";
    bool named = false, told = false;
    for (const auto& t : page.texts)
      named |= t.text == text || t.text == ToString(board), told |= t.text.find("100 %") != std::string::npos;
    EXPECT_TRUE(named && told) << text;
  }
}

/// On a sheet turned about its long edge, the back lies behind the front.
TEST(LayOutBoard, TheBackIsTheFrontInAMirror) {
  const Board board = ParseBoard("charuco:7x5:25mm:18mm:two-sided=3mm");
  BoardDrawOptions options;
  const BoardPage front = LayOutBoard(board, options);
  options.back = true;
  const BoardPage back = LayOutBoard(board, options);
  ASSERT_EQ(back.width, front.width);
  for (size_t i = 0; i < PrintOf(board).black.size(); ++i) {
    EXPECT_NEAR(back.rects[i].x, front.width - front.rects[i].x - front.rects[i].width, 1e-9);
    EXPECT_EQ(back.rects[i].y, front.rects[i].y);
    EXPECT_EQ(back.rects[i].width, front.rects[i].width);
  }
  EXPECT_THROW(LayOutBoard(FrontOf(board), options), UsageError);
}

TEST(LayOutBoard, PaperIsRotatedOrRefused) {
  EXPECT_LT(LayOutBoard(ParseBoard("chessboard:4x6:25mm"), {}).width, 211);
  EXPECT_GT(LayOutBoard(ParseBoard("chessboard:8x5:25mm"), {}).width, 296);
  const std::string message = MessageOf<UsageError>([] { LayOutBoard(ParseBoard("chessboard:9x6:40mm"), {}); });
  EXPECT_NE(message.find("440.0 x 337.0 mm"), std::string::npos) << message;
  BoardDrawOptions none;
  none.paper = Paper::kNone;
  const BoardPage page = LayOutBoard(ParseBoard("chessboard:9x6:40mm"), none);
  EXPECT_DOUBLE_EQ(page.width, 440);
  EXPECT_THROW(FromString("a9", &none.paper), UsageError);
  EXPECT_THROW(LayOutBoard(ParseBoard("grid:9x6:40mm"), {}), UsageError);
}

TEST(ToPdf, HoldsThePageToATenthOfAMicrometre) {
  for (const char* text : kBoards) {
    const BoardPage page = LayOutBoard(ParseBoard(text), {});
    const std::string pdf = ToPdf(page);
    ExpectSame(RectsOfPdf(pdf, page.height), page.rects);
    double width = 0, height = 0;
    const size_t box = pdf.find("/MediaBox [0 0 ");
    ASSERT_EQ(std::sscanf(pdf.c_str() + box, "/MediaBox [0 0 %lf %lf]", &width, &height), 2);
    EXPECT_NEAR(width / 72 * 25.4, page.width, 1e-4);
    EXPECT_NEAR(height / 72 * 25.4, page.height, 1e-4);
  }
}

/// Every offset of the cross-reference table leads to its object.
TEST(ToPdf, TableOfObjectsIsRight) {
  const std::string pdf = ToPdf(LayOutBoard(ParseBoard("tag:36h11:7:100mm"), {}));
  const size_t start = std::strtoul(pdf.c_str() + pdf.rfind("startxref\n") + 10, nullptr, 10);
  ASSERT_EQ(pdf.compare(start, 5, "xref\n"), 0);
  size_t line = pdf.find('\n', pdf.find('\n', start) + 1) + 1;
  for (int object = 1; object <= 5; ++object) {
    line = pdf.find('\n', line) + 1;
    const size_t offset = std::strtoul(pdf.substr(line, 10).c_str(), nullptr, 10);
    EXPECT_EQ(pdf.compare(offset, 7, std::to_string(object) + " 0 obj"), 0) << object;
  }
  const size_t length = std::strtoul(pdf.c_str() + pdf.find("/Length ") + 8, nullptr, 10);
  const size_t content = pdf.find("stream\n") + 7;
  EXPECT_EQ(pdf.compare(content + length, 9, "endstream"), 0);
}

TEST(ToSvg, HoldsThePage) {
  for (const char* text : kBoards) {
    const BoardPage page = LayOutBoard(ParseBoard(text), {});
    const std::string svg = ToSvg(page);
    ExpectSame(RectsOfSvg(svg), page.rects);
    double width = 0, height = 0, view_width = 0;
    ASSERT_EQ(std::sscanf(svg.c_str() + svg.find("width=\""), "width=\"%lfmm\" height=\"%lfmm\" viewBox=\"0 0 %lf", &width,
                          &height, &view_width),
              3);
    EXPECT_DOUBLE_EQ(width, page.width);
    EXPECT_DOUBLE_EQ(width, view_width) << "one unit is a millimetre";
  }
}

/// The image of the page is the page: the board is found in it, in its place and size.
TEST(ToPng, IsFoundWhereItLies) {
  for (const char* text : kBoards) {
    const Board board = ParseBoard(text);
    const BoardPrint print = PrintOf(board);
    const BoardPage page = LayOutBoard(board, {});
    const std::string png = ToPng(page, 150);
    const size_t phys = png.find("pHYs");
    ASSERT_EQ(phys, 8u + 25 + 4);
    const auto byte = [&](size_t i) { return static_cast<unsigned char>(png[phys + i]); };
    EXPECT_EQ(byte(6) << 8 | byte(7), 5906) << "pixels a metre at 150 dpi";
    EXPECT_EQ(byte(12), 1);
    const cv::Mat grey = cv::imdecode(std::vector<uint8_t>(png.begin(), png.end()), cv::IMREAD_GRAYSCALE);
    ASSERT_FALSE(grey.empty()) << "with the chunk's check sum";
    cv::Mat seen;  // as by a camera: edges along the pixels' borders have no blur that RefineCorner could fit
    cv::GaussianBlur(grey, seen, {}, 0.8);
    Image image(seen.cols, seen.rows, 1);
    std::copy(seen.data, seen.data + image.pixels.size(), image.pixels.begin());
    const BoardDetection found = DetectBoard(board, image);
    ASSERT_EQ(found.status, Status::kOk) << text << ": " << found.reason;
    EXPECT_EQ(found.detection.num_corners(), board.num_corners()) << text;
    const Eigen::Matrix3Xd corners = CornersInBoard(board);
    for (int i = 0; i < found.detection.num_corners(); ++i) {
      const Eigen::Vector2d at_mm = (corners.col(found.detection.corner_ids[i]).head<2>() - print.low_m) * 1e3;
      const Eigen::Vector2d at_px = (at_mm + Eigen::Vector2d(page.board_x, page.board_y)) * 5.906 - Eigen::Vector2d(0.5, 0.5);
      EXPECT_LT((found.detection.points_px.col(i) - at_px).norm(), 0.05) << text;
    }
  }
}

TEST(WriteBoardPage, ByExtension) {
  const ::mvstudio::testing::TempDir folder;
  const Board board = ParseBoard("tag:36h11:7:50mm");
  for (const char* name : {"a.pdf", "a.svg", "a.png"}) WriteBoardPage(board, folder / name, {});
  EXPECT_EQ(ReadFile(folder / "a.pdf").substr(0, 5), "%PDF-");
  EXPECT_EQ(ReadFile(folder / "a.png").substr(1, 3), "PNG");
  EXPECT_THROW(WriteBoardPage(board, folder / "a.gif", {}), UsageError);
  BoardDrawOptions coarse;
  coarse.dpi = 1;
  EXPECT_THROW(WriteBoardPage(board, folder / "a.png", coarse), UsageError);
}

TEST(BoardDraw, Circles) {
  const auto count = [](const std::string& text, const std::string& piece) {
    int n = 0;
    for (size_t at = text.find(piece); at != std::string::npos; at = text.find(piece, at + 1)) ++n;
    return n;
  };
  BoardDrawOptions options;
  for (const bool inverted : {false, true}) {
    const Board board = ParseBoard(std::string("acircles:4x11:15mm:8mm") + (inverted ? ":inverted" : ""));
    const BoardPage page = LayOutBoard(board, options);
    ASSERT_EQ(page.discs.size(), 44u);
    EXPECT_NEAR(page.discs[1].x - page.discs[0].x, 30, 1e-9) << "mm";
    EXPECT_NEAR(page.discs[4].y - page.discs[0].y, 15, 1e-9);
    EXPECT_NEAR(page.discs[0].radius, 4, 1e-9);
    EXPECT_EQ(count(ToSvg(page), "<circle"), 44);
    EXPECT_EQ(count(ToPdf(page), " c\n"), 4 * 44);
    const Image print = DrawBoard(board, 40, 1);
    double ink = 0;
    for (const uint8_t value : print.pixels) ink += (255 - value) / 255.0;
    const double discs = 44 * M_PI * std::pow(40 * 4 / 15.0, 2);
    const Eigen::Vector2d size = (PrintOf(board).high_m - PrintOf(board).low_m) / board.square_m * 40;
    EXPECT_NEAR(ink, inverted ? size.prod() - discs : discs, 0.005 * size.prod()) << inverted;
  }
}

}  // namespace
}  // namespace mvstudio::calib
