#pragma once

#include <string>
#include <vector>

#include "calib/detect/board_check.h"
#include "core/progress.h"
#include "stages/board/options.h"

namespace mvstudio::stages {

struct BoardDrawn {
  std::string out;
  calib::Board board;
  calib::BoardPage page;
};

/// Writes the board's page. Throws UsageError and IoError.
BoardDrawn RunBoardDraw(const BoardDrawing& options);

struct BoardSearched {
  std::vector<std::string> inputs;
  std::vector<std::string> labels;  ///< of the images that were searched
  calib::BoardCheckReport check;
};

/// Searches at most `max_images` frames, evenly spread over the sources. Throws UsageError, IoError and FormatError; a board
/// that is in no image is no error (BoardCheckReport::best).
BoardSearched RunBoardSearch(const BoardSearch& options, const RunContext& run = {});

struct BoardsProposed {
  calib::ProposeOptions options;
  std::vector<calib::BoardProposal> boards;
};

/// Throws UsageError.
BoardsProposed RunBoardProposals(const calib::ProposeOptions& options);

}  // namespace mvstudio::stages
