#include "stages/view/solids.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "calib/board/board.h"
#include "calib/board/sets.h"
#include "core/csv.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/text/number_cell.h"
#include "stages/calib/board_poses.h"
#include "stages/input/session_input.h"
#include "stages/view/scene_parts.h"

namespace mvstudio::stages {
namespace fs = std::filesystem;
namespace {

constexpr char kBodyMotionFile[] = "body_motion.bin", kBodyTextureFile[] = "body_texture.bin";
constexpr double kFlat = 1e-9;  // metres off the board's plane

std::vector<calib::Board> BoardsOf(const std::string& text) {
  std::vector<calib::Board> boards;
  std::istringstream words(text);
  for (std::string word; words >> word;) boards.push_back(calib::ParseBoard(word));
  return calib::SingleBoards(boards);
}

PlacedBoard Placed(const calib::Board& board, const geometry::Rigid3& world_from_board) {
  const Eigen::Matrix3Xd in_board = CornersInBoard(calib::FrontOf(board));
  const Eigen::Vector3d low = in_board.rowwise().minCoeff(), high = in_board.rowwise().maxCoeff();
  const auto in_world = [&](const Eigen::Matrix3Xd& points) {
    Eigen::Matrix3Xd moved(3, points.cols());
    for (Eigen::Index i = 0; i < points.cols(); ++i) moved.col(i) = world_from_board * Eigen::Vector3d(points.col(i));
    return moved;
  };
  PlacedBoard placed;
  placed.corners = in_world(in_board);
  if (high.z() - low.z() < kFlat) {
    Eigen::Matrix3Xd outline(3, 4);
    outline << low.x(), high.x(), high.x(), low.x(), low.y(), low.y(), high.y(), high.y(), low.z(), low.z(), low.z(), low.z();
    placed.outline = in_world(outline);
  }
  const double length_m = 0.5 * std::max(1e-3, (high - low).head<2>().minCoeff());
  Eigen::Matrix3Xd axes = Eigen::Matrix3Xd::Zero(3, 3);
  axes(0, 1) = axes(1, 2) = length_m;
  placed.axes = in_world(axes);
  return placed;
}

/// The numbers of a row under these names; the frame and the board come first.
std::vector<double> NumbersOfRow(CsvReader* csv, const std::vector<size_t>& columns, size_t num_cells) {
  csv->RequireCells(num_cells);
  const std::vector<std::string_view> cells = csv->Cells();
  std::vector<double> numbers;
  for (const size_t column : columns) {
    const NumberCell cell = ReadNumberCell(cells[column]);
    if (cell.kind != NumberCell::Kind::kNumber) csv->Fail("`" + std::string(cells[column]) + "` is no number");
    numbers.push_back(cell.value);
  }
  return numbers;
}

void Attempt(const std::string& what, InputNotes* notes, const std::function<void()>& read) {
  try {
    read();
  } catch (const CancelledError&) {
    throw;
  } catch (const Error& error) {
    notes->warnings.push_back({"VIEW-LEFTOUT", what + " not drawn: " + error.what(), "the rest is"});
    notes->partial = true;
  }
}

bool IsRegular(const std::string& path) {
  std::error_code none;
  return fs::is_regular_file(path, none);
}

void UseBody(const std::vector<std::string>& places, const std::string& root, OverlaySolids* solids, InputNotes* notes) {
  for (const std::string& path : places) {
    if (solids->body || !IsRegular(path)) continue;
    Attempt("the fitted body is", notes, [&] {
      RequireInside(path, root);
      solids->body = ReadMovingBody(path);
    });
    notes->inputs.push_back(path);
    const std::string colours = (fs::path(path).parent_path() / kBodyTextureFile).string();
    if (!solids->body || !IsRegular(colours)) continue;
    Attempt("the body's colours are", notes, [&] {
      RequireInside(colours, root);
      solids->colours = ReadBodyColours(colours, solids->body->rest.cols());
    });
    notes->inputs.push_back(colours);
  }
}

}  // namespace

std::map<int, std::vector<PlacedBoard>> ReadPlacedBoards(const std::string& path, const std::string& boards) {
  const std::vector<calib::Board> known = BoardsOf(boards);
  const std::string text = ReadFile(path);
  CsvReader csv(path, text);
  if (!csv.NextLine()) throw FormatError(path, "", "is empty");
  const std::vector<std::string> header(csv.Cells().begin(), csv.Cells().end());
  std::vector<size_t> columns;
  for (const char* name : {"frame", "board", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"}) {
    const auto found = std::find(header.begin(), header.end(), name);
    if (found == header.end()) csv.Fail(std::string("has no column ") + name);
    columns.push_back(static_cast<size_t>(found - header.begin()));
  }
  std::map<int, std::vector<PlacedBoard>> placed;
  while (csv.NextLine()) {
    csv.Cells();
    const std::vector<double> row = NumbersOfRow(&csv, columns, header.size());
    if (!(row[0] >= 0 && row[0] <= 1e9 && row[1] >= 0)) csv.Fail("has no frame or board");
    if (row[1] >= static_cast<double>(known.size())) continue;  // the session states fewer
    const Eigen::Quaterniond turn(row[8], row[5], row[6], row[7]);
    if (!(std::abs(turn.norm() - 1) < 1e-3)) csv.Fail("has a rotation that is none");
    const geometry::Rigid3 world_from_board{turn.normalized(), {row[2], row[3], row[4]}};
    placed[static_cast<int>(row[0])].push_back(Placed(known[static_cast<size_t>(row[1])], world_from_board));
  }
  return placed;
}

SolidsNow SolidsAt(const OverlaySolids& solids, int step) {
  SolidsNow now;
  if (const auto found = solids.boards.find(step); found != solids.boards.end()) now.boards = found->second;
  if (!solids.body) return now;
  if (auto vertices = BodyAt(*solids.body, step)) now.vertices = std::move(*vertices), now.faces = solids.body->faces;
  return now;
}

OverlaySolids ReadSolids(const ViewSceneOptions& options, const SolidsWanted& wanted, const Scene& scene, InputNotes* notes) {
  OverlaySolids solids;
  if (scene.kind != "session") {
    const std::string& folder = options.path;
    if (wanted.body)
      UseBody({folder + "/" + kBodyMotionFile, folder + "/avatar/" + kBodyMotionFile}, scene.root, &solids, notes);
    return solids;
  }
  InputNotes said;  // by ReadScene already
  const auto found = FindTake({options.path, options.take, options.allow_outside}, &said);
  const dataset::Session& session = found->session;
  if (wanted.body)
    UseBody({dataset::TakeFolder(session, "avatar", found->take.name) + "/" + kBodyMotionFile}, scene.root, &solids, notes);
  const std::string calib = dataset::CalibrationOf(session, options.allow_outside);
  const std::string poses = (fs::path(calib).parent_path() / kBoardPosesFile).string();
  const bool films_boards = found->take.kind == dataset::TakeKind::kBoard;
  if (!wanted.boards || !films_boards || calib.empty() || session.board.empty() || !IsRegular(poses)) return solids;
  Attempt("boards are", notes, [&] { solids.boards = ReadPlacedBoards(poses, session.board); });
  notes->inputs.push_back(poses);
  return solids;
}

}  // namespace mvstudio::stages
