#include "calib/corners/corner_readers.h"
#include "calib/corners/detection_builder.h"
#include "calib/formats/document.h"
#include "calib/formats/opencv_yaml.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

double NumberAt(const Entries& entries, const char* key) {
  const Entry* const entry = FindEntry(entries, key);
  return entry ? ReadNumber(*entry) : 0;
}

/// The grid that the file names, or nothing.
std::optional<Board> GridOf(const Entries& entries, double metres_per_unit) {
  Board board;
  board.kind = Board::Kind::kGrid;
  board.cols = static_cast<int>(NumberAt(entries, "boardwidth")),
  board.rows = static_cast<int>(NumberAt(entries, "boardheight"));
  board.square_m = NumberAt(entries, "squaresize") * metres_per_unit;
  const bool whole = board.cols > 1 && board.rows > 1 && board.cols <= 200 && board.rows <= 200 && board.square_m > 0;
  return whole ? std::optional(board) : std::nullopt;
}

}  // namespace

CornerFile ReadOpenCvSample(const std::string& path, const CornerFileOptions& options) {
  Entries entries;
  ReadEntries(path, true, &entries);
  const Entry* const points = FindEntry(entries, "imagepoints");
  if (!points) throw FormatError(path, "image_points", "this key is missing");
  const ValueView view(path, points->value, "image_points");
  const double rows = view["rows"].Number(), cols = view["cols"].Number();
  const Eigen::VectorXd data = view["data"].Vector();
  const auto per_view = static_cast<Eigen::Index>(cols);
  if (!(cols >= 1) || cols > 1e6 || static_cast<double>(data.size()) != 2 * rows * cols)
    view.Fail(std::to_string(data.size()) + " numbers, not two for each corner of each view");
  const std::optional<Board> stated = GridOf(entries, MetresPer(options.unit));
  if (!stated && !options.board)
    throw UsageError(path + ": the file names no board (board_width, board_height, square_size); give option 'board'");
  CornerFile file;
  DetectionBuilder builder(path);
  file.cameras.push_back(
      {"camera", static_cast<int>(NumberAt(entries, "imagewidth")), static_cast<int>(NumberAt(entries, "imageheight"))});
  const int camera = builder.Camera("camera");
  for (Eigen::Index i = 0; 2 * i < data.size(); ++i) {
    builder.Add(camera, i / per_view, 0, static_cast<int>(i % per_view), data.segment<2>(2 * i), 1,
                "image_points[" + std::to_string(i / per_view) + "]");
  }
  file.boards = {options.board ? *options.board : *stated};
  if (file.boards[0].num_corners() != per_view)
    throw FormatError(path, "image_points",
                      std::to_string(per_view) + " corners a view, the board " + ToString(file.boards[0]) + " has " +
                          std::to_string(file.boards[0].num_corners()));
  if (options.board && stated && stated->num_corners() == options.board->num_corners()) {
    std::map<int, Eigen::Vector3d> places;
    const Eigen::Matrix3Xd corners = CornersInBoard(*stated);
    for (Eigen::Index i = 0; i < corners.cols(); ++i) places.emplace(static_cast<int>(i), corners.col(i));
    CompareBoard(places, *options.board, path, &file.notes);
  }
  file.detections = builder.Finish();
  return file;
}

}  // namespace mvstudio::calib::internal
