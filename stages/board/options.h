#pragma once

#include <string>
#include <vector>

#include "calib/board/draw.h"
#include "calib/board/propose.h"
#include "core/choice/option_style.h"

/// Boards that are proposed, drawn or looked for: what a caller gives. Proposals take calib::ProposeOptions.
namespace mvstudio::stages {

struct BoardDrawing {
  std::string board;  ///< calib::kBoardForms
  std::string out;    ///< .pdf, .svg or .png
  calib::BoardDrawOptions page;
};

/// Without the board.
template <class Visitor>
void VisitFields(Visitor&& visit, BoardDrawing& o) {
  VisitStyled(visit, OptionStyle::kFile, "out", o.out, "file to write: .pdf, .svg or .png");
  VisitFields(visit, o.page);
}

struct BoardSearch {
  std::vector<std::string> images;  ///< files, folders, patterns or videos
  std::string board;                ///< the expected one; empty: every kind
  int max_images = 30;
};

/// Without the images.
template <class Visitor>
void VisitFields(Visitor&& visit, BoardSearch& o) {
  visit("board", o.board, "the expected board; lengths are taken from it. Without it every kind is searched for");
  visit("max-images", o.max_images, "maximum number of images to search");
}

}  // namespace mvstudio::stages
