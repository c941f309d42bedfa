#include <toml++/toml.h>

#include <filesystem>
#include <set>

#include "calib/corners/corner_readers.h"
#include "calib/corners/detection_builder.h"
#include "calib/formats/csv_table.h"
#include "core/disk/files.h"
#include "core/disk/place.h"
#include "core/error.h"
#include "core/toml_depth.h"

namespace mvstudio::calib::internal {
namespace {

constexpr char kSyncHint[] =
    "frame numbers of different cameras are not time steps: caliscope pairs frames by sync_index (its xy.csv and "
    "timestamps.csv "
    "have it); export the corners with that column";

struct Columns {
  int sync, camera, frame, object, corner, x, y, board_x, board_y, board_z;

  explicit Columns(const CsvTable& table)
      : sync(table.Find({"sync_index"})),
        camera(table.Require({"cam_id", "port", "camera_id", "cam"})),
        frame(table.Find({"frame_index"})),
        object(table.Find({"object_id"})),
        corner(table.Require({"keypoint_id", "point_id"})),
        x(table.Require({"img_loc_x"})),
        y(table.Require({"img_loc_y"})),
        board_x(table.Find({"obj_loc_x", "board_loc_x"})),
        board_y(table.Find({"obj_loc_y", "board_loc_y"})),
        board_z(table.Find({"obj_loc_z", "board_loc_z"})) {}
  bool has_points() const { return board_x >= 0 && board_y >= 0; }
};

/// The column with the time step of a row: sync_index, or frame_index when there is only one camera.
int TimeStepColumn(const CsvTable& table, const Columns& columns) {
  if (columns.sync >= 0) return columns.sync;
  std::set<int64_t> cameras;
  for (size_t row = 0; row < table.num_rows(); ++row) cameras.insert(table.Integer(row, columns.camera));
  if (columns.frame >= 0 && cameras.size() == 1) return columns.frame;
  throw FormatError(table.path(), "header", std::string("no column 'sync_index'; ") + kSyncHint);
}

/// A camera has one frame per time step, and its frames keep their order.
void CheckFrameOrder(const CsvTable& table, const Columns& columns) {
  if (columns.sync < 0 || columns.frame < 0) return;
  std::map<int64_t, std::map<int64_t, std::pair<int64_t, size_t>>> frames;  // camera -> time step -> frame, row
  for (size_t row = 0; row < table.num_rows(); ++row) {
    const int64_t frame = table.Frame(row, columns.frame);
    const auto [entry, is_new] =
        frames[table.Integer(row, columns.camera)].insert({table.Frame(row, columns.sync), {frame, row}});
    if (!is_new && entry->second.first != frame) {
      throw FormatError(table.path(), table.Where(row, columns.frame),
                        "frame " + std::to_string(frame) + " at a time step that already has frame " +
                            std::to_string(entry->second.first) + " of this camera");
    }
  }
  for (const auto& [camera, time_steps] : frames) {
    const std::pair<int64_t, size_t>* last = nullptr;
    for (const auto& [time_step, frame] : time_steps) {
      if (last && frame.first <= last->first) {
        throw FormatError(table.path(), table.Where(frame.second, columns.sync),
                          "the frames of camera " + std::to_string(camera) + " go backwards in time");
      }
      last = &frame;
    }
  }
}

struct ObjectPoints {
  std::vector<Board> boards;
  std::map<int64_t, int> board_of_object;
  std::vector<std::map<int64_t, int>> corner_of_id;  // per board
};

/// Points of every object as the rows give them: the same id always has the same place.
ObjectPoints CollectPoints(const CsvTable& table, const Columns& columns, double scale) {
  std::map<int64_t, std::map<int64_t, Eigen::Vector3d>> objects;
  for (size_t row = 0; row < table.num_rows(); ++row) {
    const Eigen::Vector3d point(table.Number(row, columns.board_x), table.Number(row, columns.board_y),
                                columns.board_z >= 0 ? table.Number(row, columns.board_z) : 0);
    const int64_t object = columns.object >= 0 ? table.Integer(row, columns.object) : 0;
    const int64_t id = table.Integer(row, columns.corner);
    const auto [entry, is_new] = objects[object].insert({id, scale * point});
    if (!is_new && (entry->second - scale * point).norm() > 1e-6 * (1 + point.norm()) * scale) {
      throw FormatError(table.path(), table.Where(row, columns.board_x),
                        "keypoint " + std::to_string(id) + " lies elsewhere on the board than in an earlier row");
    }
  }
  ObjectPoints out;
  for (const auto& [object, points] : objects) {
    Eigen::Matrix3Xd matrix(3, static_cast<Eigen::Index>(points.size()));
    std::map<int64_t, int> corners;
    for (const auto& [id, point] : points) {
      const auto corner = static_cast<int>(corners.size());
      matrix.col(corner) = point;
      corners[id] = corner;
    }
    out.board_of_object[object] = static_cast<int>(out.boards.size());
    out.boards.push_back(BoardFromPoints(matrix));
    out.corner_of_id.push_back(std::move(corners));
  }
  return out;
}

/// Image sizes of the session's camera_array.toml, by camera id; empty when there is none.
std::map<int64_t, std::pair<int, int>> FindSizes(const std::string& path, std::string* found) {
  std::map<int64_t, std::pair<int, int>> sizes;
  std::filesystem::path folder = std::filesystem::path(PathOnDisk(path)).parent_path();
  for (int up = 0; up <= 3; ++up, folder = folder.parent_path()) {
    const std::string file = (folder / "camera_array.toml").string();
    std::error_code ignored;
    if (!std::filesystem::is_regular_file(file, ignored)) continue;
    toml::table root;
    const std::string text = ReadFile(file);
    RequireParsableToml(text, file);
    try {
      root = toml::parse(text);
    } catch (const toml::parse_error& error) {
      throw FormatError(file, "line " + std::to_string(error.source().begin.line), std::string(error.description()));
    }
    const toml::table* nested = root.get_as<toml::table>("cameras");
    for (const auto& [key, node] : nested ? *nested : root) {
      const toml::table* table = node.as_table();
      if (!table) continue;
      const auto id =
          table->contains("cam_id") ? table->at_path("cam_id").value<int64_t>() : table->at_path("port").value<int64_t>();
      const auto width = table->at_path("size[0]").value<double>(), height = table->at_path("size[1]").value<double>();
      if (!id || !width || !height || !(*width >= 1 && *width <= 1 << 20) || !(*height >= 1 && *height <= 1 << 20)) continue;
      sizes[*id] = {static_cast<int>(*width), static_cast<int>(*height)};
    }
    *found = file;
    return sizes;
  }
  return sizes;
}

void AddCameras(const CsvTable& table, const std::vector<int64_t>& ids, CornerFile* file) {
  std::string found;
  const auto sizes = FindSizes(table.path(), &found);
  for (const int64_t id : ids) {
    const auto size = sizes.find(id);
    file->cameras.push_back({"cam_" + std::to_string(id), size == sizes.end() ? 0 : size->second.first,
                             size == sizes.end() ? 0 : size->second.second});
  }
  if (!found.empty()) file->notes.push_back({"CAL-SIZES", "image sizes come from " + found, ""});
}

}  // namespace

CornerFile ReadCaliscope(const std::string& path, const CornerFileOptions& options) {
  const CsvTable table(path);
  const Columns columns(table);
  const int time_step = TimeStepColumn(table, columns);
  CheckFrameOrder(table, columns);
  if (!options.board && !columns.has_points()) {
    throw UsageError(path + ": this corner file does not say where the corners lie on the board; give option 'board'");
  }
  ObjectPoints points;
  if (options.board) {
    points.boards = {*options.board};
  } else {
    points = CollectPoints(table, columns, MetresPer(options.unit));
  }
  std::set<int64_t> ids;
  for (size_t row = 0; row < table.num_rows(); ++row) ids.insert(table.Integer(row, columns.camera));
  DetectionBuilder builder(path);
  for (const int64_t id : ids) builder.Camera("cam_" + std::to_string(id));
  for (size_t row = 0; row < table.num_rows(); ++row) {
    const int camera = builder.Camera("cam_" + std::to_string(table.Integer(row, columns.camera)));
    const int64_t object = columns.object >= 0 ? table.Integer(row, columns.object) : 0;
    const int64_t id = table.Integer(row, columns.corner);
    const int board = options.board ? 0 : points.board_of_object.at(object);
    if (options.board && (id < 0 || id >= options.board->num_corners())) {
      throw FormatError(path, table.Where(row, columns.corner),
                        "keypoint " + std::to_string(id) + " is not on the board, which has " +
                            std::to_string(options.board->num_corners()) + " corners; is option 'board' the right one?");
    }
    const int corner = options.board ? static_cast<int>(id) : points.corner_of_id[static_cast<size_t>(board)].at(id);
    builder.Add(camera, table.Integer(row, time_step), board, corner,
                {table.Number(row, columns.x), table.Number(row, columns.y)}, 1, table.Where(row));
  }
  CornerFile file;
  if (options.board && columns.has_points()) {
    const ObjectPoints stated = CollectPoints(table, columns, MetresPer(options.unit));
    for (size_t b = 0; b < stated.boards.size(); ++b) {
      const Eigen::Matrix3Xd places = CornersInBoard(stated.boards[b]);
      std::map<int, Eigen::Vector3d> by_id;
      for (const auto& [id, corner] : stated.corner_of_id[b]) by_id[static_cast<int>(id)] = places.col(corner);
      CompareBoard(by_id, *options.board, path, &file.notes);
    }
  }
  file.boards = points.boards;
  file.detections = builder.Finish();
  AddCameras(table, {ids.begin(), ids.end()}, &file);
  return file;
}

}  // namespace mvstudio::calib::internal
