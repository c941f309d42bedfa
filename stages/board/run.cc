#include "stages/board/run.h"

#include <algorithm>
#include <optional>

#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/footage/frames.h"

namespace mvstudio::stages {
namespace {

/// At most `max_images` frames of every source, evenly spread, with their labels.
std::vector<Image> ReadSpreadImages(const BoardSearch& options, std::vector<std::string>* labels) {
  if (options.max_images < 1) throw UsageError("option 'max-images' must be 1 or more");
  std::vector<Image> images;
  const int64_t share = std::max<int64_t>(1, options.max_images / static_cast<int64_t>(options.images.size()));
  for (const std::string& path : options.images) {
    const auto source = dataset::OpenFrames(path, {false, true, true});
    const int64_t stride = std::max<int64_t>(1, (source->num_frames() + share - 1) / share);
    int64_t position = 0;
    for (int64_t taken = 0; taken < share; ++position) {
      auto frame = source->Next();
      if (!frame) break;
      if (position % stride != 0) continue;
      images.push_back(std::move(frame->rgb));
      labels->push_back(frame->label);
      ++taken;
    }
  }
  if (images.empty()) throw FormatError(options.images.front(), "", "holds no image");
  return images;
}

}  // namespace

BoardDrawn RunBoardDraw(const BoardDrawing& options) {
  const calib::Board board = calib::ParseBoard(options.board);
  const OutputFiles place({options.out}, {});
  calib::WriteBoardPage(board, options.out, options.page);
  return {options.out, board, calib::LayOutBoard(board, options.page)};
}

BoardSearched RunBoardSearch(const BoardSearch& options, const RunContext& run) {
  std::optional<calib::Board> given;
  if (!options.board.empty()) given = calib::ParseBoard(options.board);
  if (given && (given->kind == calib::Board::Kind::kGrid || given->kind == calib::Board::Kind::kPoints)) {
    throw UsageError("board " + options.board + " is for corner files and cannot be searched in images");
  }
  BoardSearched searched;
  searched.inputs = options.images;
  searched.check = calib::CheckBoard(given, ReadSpreadImages(options, &searched.labels), run);
  return searched;
}

BoardsProposed RunBoardProposals(const calib::ProposeOptions& options) { return {options, calib::ProposeBoards(options)}; }

}  // namespace mvstudio::stages
