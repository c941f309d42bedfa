#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "calib/board/board.h"

namespace mvstudio::calib {

enum class Paper {
  kA4,
  kA3,
  kA2,
  kA1,
  kLetter,
  kNone,  ///< a page as large as the board needs
};
/// As an option, see core/fields.h.
std::string_view ToString(Paper paper);
void FromString(const std::string& text, Paper* paper);

struct BoardDrawOptions {
  Paper paper = Paper::kA4;
  double dpi = 300;   ///< of PNG files
  bool back = false;  ///< of a two-sided board: the print in a mirror, for a duplex printer that turns the sheet about its long
                      ///< edge
};

template <class Visitor>
void VisitFields(Visitor&& visit, BoardDrawOptions& o) {
  visit("paper", o.paper,
        "a4, a3, a2, a1, letter (rotated when the board fits better), or none: a page as large as the board needs");
  visit("dpi", o.dpi, "resolution of PNG files, pixels an inch");
  visit("back", o.back, "draw the back of a two-sided board: the print in a mirror");
}

/// A page to be printed: millimetres, from the top left, y down. Black on white.
struct BoardPage {
  struct Rect {
    double x = 0, y = 0, width = 0, height = 0;
  };
  struct Text {
    double x = 0, y = 0, size = 0;  ///< left end of the baseline, height of the font
    std::string text;
  };
  double width = 0, height = 0;
  double board_x = 0, board_y = 0;  ///< top left corner of the print (BoardPrint::low_m)
  struct Disc {
    double x = 0, y = 0, radius = 0;
  };
  std::vector<Rect> rects;
  std::vector<Disc> discs;
  bool white_discs = false;  ///< over the rectangles
  std::vector<Text> texts;
};

/// True when the board fits on the paper with its white margin and the ruler.
bool FitsPaper(const Board& board, const BoardDrawOptions& options);

/// Places the board with its white margin, a ruler of 100 mm and a line that describes the board. Throws UsageError with
/// the required size when the paper is too small, and for the back of a board that has none.
BoardPage LayOutBoard(const Board& board, const BoardDrawOptions& options);

/// The page as file content: PDF 1.4 and SVG 1.1 with vectors at true scale, PNG with its resolution in the pHYs chunk.
std::string ToPdf(const BoardPage& page);
std::string ToSvg(const BoardPage& page);
std::string ToPng(const BoardPage& page, double dpi);

/// Writes `path` in the format of its extension (.pdf, .svg or .png).
void WriteBoardPage(const Board& board, const std::string& path, const BoardDrawOptions& options);

}  // namespace mvstudio::calib
