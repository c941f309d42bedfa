#include "core/csv.h"

#include <cstring>
#include <map>
#include <sstream>

#include "calib/corners/corner_readers.h"
#include "calib/corners/detection_builder.h"
#include "calib/formats/csv_table.h"
#include "calib/formats/format_text.h"
#include "core/check.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/text/shortest_text.h"

namespace mvstudio::calib {
namespace {

constexpr char kTitle[] = "mvstudio corners 1";

void RequireWritable(const std::string& name) {
  constexpr char kSpace[] = " \t\v\f";  // at the ends it would be lost
  const bool bare = !name.empty() && !std::strchr(kSpace, name.front()) && !std::strchr(kSpace, name.back());
  if (!bare || name.find_first_of("\r\n") != std::string::npos)
    throw UsageError("the camera name '" + internal::Printable(name) + "' cannot be written to a corner file");
}

void WriteHeader(const CornerFile& file, std::ostringstream* out) {
  *out << "# " << kTitle << "\n# pixel (0, 0) is the centre of the top-left pixel; lengths are metres\n";
  for (const CameraInput& camera : file.cameras) {
    RequireWritable(camera.name);
    *out << "# camera " << camera.width_px << "x" << camera.height_px << " " << camera.name << "\n";
  }
  for (size_t b = 0; b < file.boards.size(); ++b) {
    const Board& board = file.boards[b];
    const bool points = board.kind == Board::Kind::kPoints;
    *out << "# board " << b << " " << (points ? "points" : ToString(board)) << "\n";
    for (Eigen::Index i = 0; points && i < board.points.cols(); ++i) {
      *out << "# point " << b << " " << i;
      for (int k = 0; k < 3; ++k) *out << " " << ShortestText(board.points(k, i));
      *out << "\n";
    }
  }
}

/// The `#` lines of the file.
class Header {
 public:
  Header(const CsvTable& table, internal::DetectionBuilder* builder, CornerFile* file) : path_(table.path()) {
    for (const CsvTable::Comment& comment : table.comments()) {
      std::istringstream in(comment.text);
      std::string word;
      in >> word;
      place_ = "line " + std::to_string(comment.line);
      if (word == "mvstudio" && comment.text != kTitle) Fail(kTitle);
      if (word == "camera") ReadCamera(&in, builder, file);
      if (word == "board") ReadBoard(&in, file);
      if (word == "point") ReadPoint(&in, file);
    }
  }

 private:
  [[noreturn]] void Fail(const std::string& expected) const { throw FormatError(path_, place_, "expected '" + expected + "'"); }

  void ReadCamera(std::istringstream* in, internal::DetectionBuilder* builder, CornerFile* file) const {
    std::string size, name;
    *in >> size >> std::ws;
    std::getline(*in, name);
    if (name.empty()) Fail("# camera WIDTHxHEIGHT NAME");
    if (builder->Camera(name) != static_cast<int>(file->cameras.size()))
      throw FormatError(path_, place_, "the camera '" + internal::Printable(name) + "' is listed twice");
    std::pair<int, int> wh{0, 0};
    try {
      if (size != "0x0") wh = internal::ParseSize(size, "size");
    } catch (const UsageError& error) {
      throw FormatError(path_, place_, error.what());
    }
    file->cameras.push_back({name, wh.first, wh.second});
  }

  void ReadBoard(std::istringstream* in, CornerFile* file) const {
    size_t index = 0;
    std::string text;
    if (!(*in >> index >> text) || index != file->boards.size()) Fail("# board NUMBER BOARD, numbered from 0");
    Board board;
    board.kind = Board::Kind::kPoints;
    board.points.resize(3, 0);
    try {
      if (text != "points") board = ParseBoard(text);
    } catch (const UsageError& error) {
      throw FormatError(path_, place_, error.what());
    }
    file->boards.push_back(board);
  }

  void ReadPoint(std::istringstream* in, CornerFile* file) const {
    size_t index = 0;
    Eigen::Index corner = 0;
    std::string x, y, z;
    const bool read = static_cast<bool>(*in >> index >> corner >> x >> y >> z);
    if (!read || index >= file->boards.size() || file->boards[index].kind != Board::Kind::kPoints ||
        corner != file->boards[index].points.cols()) {
      Fail("# point BOARD CORNER X Y Z, after '# board NUMBER points', numbered from 0");
    }
    Eigen::Matrix3Xd& points = file->boards[index].points;
    points.conservativeResize(3, corner + 1);
    const internal::Place place{path_, place_};
    points(0, corner) = internal::ParseNumber(x, place);
    points(1, corner) = internal::ParseNumber(y, place);
    points(2, corner) = internal::ParseNumber(z, place);
  }

  std::string path_, place_;
};

}  // namespace

namespace internal {

CornerFile ReadCornerCsv(const std::string& path, const CornerFileOptions& options) {
  const CsvTable table(path);
  const int camera = table.Require({"camera"}), frame = table.Require({"frame"}), corner = table.Require({"corner"}),
            x = table.Require({"x_px"}), y = table.Require({"y_px"}), board = table.Find({"board"}),
            sigma = table.Find({"sigma_px"});
  CornerFile file;
  DetectionBuilder builder(path);
  const Header header(table, &builder, &file);
  if (options.board && !file.boards.empty()) {
    std::map<int, Eigen::Vector3d> stated;
    const Eigen::Matrix3Xd places = CornersInBoard(file.boards[0]);
    for (Eigen::Index i = 0; i < places.cols(); ++i) stated[static_cast<int>(i)] = places.col(i);
    CompareBoard(stated, *options.board, path, &file.notes);
  }
  if (options.board) file.boards = {*options.board};
  if (file.boards.empty()) {
    throw UsageError(path + ": this corner file does not say what the board is ('# board 0 …'); give option 'board'");
  }
  for (size_t row = 0; row < table.num_rows(); ++row) {
    const int64_t board_idx = board >= 0 ? table.Integer(row, board) : 0;
    if (board_idx < 0 || board_idx >= static_cast<int64_t>(file.boards.size())) {
      throw FormatError(path, table.Where(row, board), "there are " + std::to_string(file.boards.size()) + " boards");
    }
    const int64_t id = table.Integer(row, corner);
    if (id < 0 || id >= file.boards[static_cast<size_t>(board_idx)].num_corners())
      throw FormatError(path, table.Where(row, corner), "corner " + std::to_string(id) + " is not on the board");
    builder.Add(builder.Camera(table.Text(row, camera)), table.Frame(row, frame), static_cast<int>(board_idx),
                static_cast<int>(id), {table.Number(row, x), table.Number(row, y)}, sigma >= 0 ? table.Number(row, sigma) : 1,
                table.Where(row));
  }
  for (size_t c = file.cameras.size(); c < builder.cameras().size(); ++c) file.cameras.push_back({builder.cameras()[c], 0, 0});
  file.detections = builder.Finish();
  return file;
}

}  // namespace internal

void WriteCornerFile(const CornerFile& file, const std::string& path) {
  std::ostringstream out;
  WriteHeader(file, &out);
  bool sigmas = false;
  for (const Detection& detection : file.detections) sigmas |= detection.sigmas_px.size() > 0 || detection.sigma_px != 1;
  out << "camera,frame,board,corner,x_px,y_px" << (sigmas ? ",sigma_px" : "") << "\n";
  for (const Detection& detection : file.detections) {
    MVS_CHECK(detection.camera_idx >= 0 && detection.camera_idx < static_cast<int>(file.cameras.size()),
              "camera " << detection.camera_idx);
    const std::string start = CsvCell(file.cameras[static_cast<size_t>(detection.camera_idx)].name) + "," +
                              std::to_string(detection.frame_idx) + "," + std::to_string(detection.board_idx) + ",";
    for (int i = 0; i < detection.num_corners(); ++i) {
      out << start << detection.corner_ids[static_cast<size_t>(i)] << "," << ShortestText(detection.points_px(0, i)) << ","
          << ShortestText(detection.points_px(1, i));
      if (sigmas) out << "," << ShortestText(detection.sigmas_px.size() > 0 ? detection.sigmas_px[i] : detection.sigma_px);
      out << "\n";
    }
  }
  WriteFileAtomic(path, out.str());
}

}  // namespace mvstudio::calib
