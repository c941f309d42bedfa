#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <sstream>

#include "calib/formats.h"
#include "calib/formats_internal.h"
#include "core/error.h"
#include "core/files.h"
#include "geometry/rigid3.h"

namespace mvstudio::calib {
namespace {

using internal::Place;

/// A top-level entry of a FileStorage file: its text, and the indented lines that follow.
struct Entry {
  std::string value, block;
  Place place;
};
/// By lower-case key without underscores: OpenCV's own samples write camera_matrix, Camera_Matrix and cameraMatrix.
using Entries = std::map<std::string, Entry>;

std::string Normalised(const std::string& key) {
  std::string plain;
  for (const char c : key) {
    if (c != '_') plain += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return plain;
}

std::string Trimmed(const std::string& text) {
  const size_t first = text.find_first_not_of(" \t\r\n");
  return first == std::string::npos ? "" : text.substr(first, text.find_last_not_of(" \t\r\n") + 1 - first);
}

void ReadEntries(const std::string& path, Entries* entries) {
  std::istringstream lines(ReadFile(path));
  std::string line;
  if (!std::getline(lines, line) || line.compare(0, 5, "%YAML") != 0) {
    throw FormatError(path, "line 1", "OpenCV's YAML files begin with %YAML:1.0");
  }
  Entry* current = nullptr;
  for (int number = 2; std::getline(lines, line); ++number) {
    if (line.empty() || line[0] == '#' || line.compare(0, 3, "---") == 0 || line.compare(0, 3, "...") == 0) continue;
    if (line[0] == ' ' || line[0] == '\t' || line[0] == '-') {
      if (current) current->block += line + "\n";
      continue;
    }
    const std::string where = "line " + std::to_string(number);
    const size_t colon = line.find(':');
    if (colon == std::string::npos) throw FormatError(path, where, "'key: value' was expected; is the file truncated?");
    const auto [entry, is_new] = entries->insert({Normalised(line.substr(0, colon)), {}});
    if (!is_new) throw FormatError(path, where, "the key '" + internal::Printable(line.substr(0, colon)) + "' stands twice");
    current = &entry->second;
    current->value = Trimmed(line.substr(colon + 1));
    current->place = {path, internal::Printable(line.substr(0, colon))};
  }
}

/// The number behind `key:` in the block of a matrix.
int BlockInteger(const Entry& entry, const std::string& key) {
  const size_t at = entry.block.find(key + ":");
  const size_t start = at == std::string::npos ? at : at + key.size() + 1;
  const size_t end = start == std::string::npos ? start : entry.block.find('\n', start);
  if (end == std::string::npos)
    throw FormatError(entry.place.path, entry.place.where, "'" + key + "' is missing in this matrix");
  const double number = internal::ParseNumber(entry.block.substr(start, end - start), entry.place);
  if (!(number >= 0 && number <= 10000) || number != std::floor(number)) {
    throw FormatError(entry.place.path, entry.place.where, "'" + key + "' is out of range");
  }
  return static_cast<int>(number);
}

Eigen::MatrixXd ReadMatrix(const Entry& entry) {
  const auto fail = [&](const std::string& what) { throw FormatError(entry.place.path, entry.place.where, what); };
  if (entry.value.compare(0, 15, "!!opencv-matrix") != 0) fail("an !!opencv-matrix was expected");
  const int rows = BlockInteger(entry, "rows"), cols = BlockInteger(entry, "cols");
  const size_t open = entry.block.find('['), close = entry.block.find(']');
  if (open == std::string::npos || close == std::string::npos || close < open)
    fail("the numbers in [ ] are incomplete; is the file truncated?");
  std::vector<double> numbers;
  std::istringstream data(entry.block.substr(open + 1, close - open - 1));
  for (std::string item; std::getline(data, item, ',');) {
    const Place place{entry.place.path, entry.place.where + "[" + std::to_string(numbers.size()) + "]"};
    numbers.push_back(internal::ParseNumber(item, place));
  }
  if (numbers.size() != static_cast<size_t>(rows) * cols) {
    fail(std::to_string(numbers.size()) + " numbers for " + std::to_string(rows) + " x " + std::to_string(cols));
  }
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(numbers.data(), rows, cols);
}

const Entry* Find(const Entries& entries, const std::string& key) {
  const auto found = entries.find(key);
  return found == entries.end() ? nullptr : &found->second;
}

/// The first of several names of the same thing.
const Entry* FindFirst(const Entries& entries, std::initializer_list<const char*> keys) {
  for (const char* key : keys) {
    if (const Entry* entry = Find(entries, key)) return entry;
  }
  return nullptr;
}

Eigen::Matrix3d ReadMatrix3(const Entry& entry) {
  const Eigen::MatrixXd matrix = ReadMatrix(entry);
  if (matrix.rows() != 3 || matrix.cols() != 3)
    throw FormatError(entry.place.path, entry.place.where, "a 3x3 matrix was expected");
  return matrix;
}

Eigen::VectorXd ReadVector(const Entry& entry) {
  const Eigen::MatrixXd matrix = ReadMatrix(entry);
  if (matrix.rows() != 1 && matrix.cols() != 1) throw FormatError(entry.place.path, entry.place.where, "a vector was expected");
  return Eigen::Map<const Eigen::VectorXd>(matrix.data(), matrix.size());
}

/// Distortion with the zeros cut off that OpenCV writes for its thin-prism and tilt terms.
Eigen::VectorXd ReadDistortion(const Entry* entry) {
  if (!entry) return Eigen::VectorXd();
  Eigen::VectorXd distortion = ReadVector(*entry);
  if (distortion.size() > 8 && distortion.tail(distortion.size() - 8).isZero(0)) distortion.conservativeResize(8);
  return distortion;
}

Eigen::Vector2d ReadSize(const Entries& entries, const std::string& path, const OpenCvOptions& options) {
  const Entry* width = FindFirst(entries, {"imagewidth", "width"});
  const Entry* height = FindFirst(entries, {"imageheight", "height"});
  if (width && height) {
    return {internal::ParseNumber(width->value, width->place), internal::ParseNumber(height->value, height->place)};
  }
  if (options.width_px <= 0 || options.height_px <= 0) {
    throw UsageError(path + ": the file does not give the image size; pass --size WIDTHxHEIGHT");
  }
  return {options.width_px, options.height_px};
}

geometry::RigCamera ReadCamera(const Entries& entries, const std::string& name, const Entry& matrix, const Entry* distortion,
                               const Eigen::Vector2d& size) {
  const Entry* fisheye = Find(entries, "fisheyemodel");
  const bool is_fisheye = fisheye && fisheye->value != "0";
  geometry::RigCamera camera;
  camera.camera =
      internal::MakeCamera(name, size[0], size[1], ReadMatrix3(matrix), ReadDistortion(distortion), is_fisheye, matrix.place);
  return camera;
}

geometry::Rigid3 ReadStereo(const Entry& rotation, const Entry& translation, double metres_per_unit) {
  geometry::Rigid3 right_from_left;
  const Eigen::MatrixXd r = ReadMatrix(rotation);
  right_from_left.rotation = r.size() == 3 ? geometry::RotationExp(ReadVector(rotation))
                                           : internal::MakeRotation(ReadMatrix3(rotation), rotation.place);
  const Eigen::VectorXd t = ReadVector(translation);
  if (t.size() != 3) throw FormatError(translation.place.path, translation.place.where, "3 numbers were expected");
  right_from_left.translation = t * metres_per_unit;
  return right_from_left;
}

void AddStereo(const Entries& entries, const Eigen::Vector2d& size, const OpenCvOptions& options, ImportedRig* imported) {
  geometry::Rig& rig = imported->rig;
  rig.cameras.push_back(ReadCamera(entries, "left", entries.at("m1"), Find(entries, "d1"), size));
  rig.cameras.push_back(ReadCamera(entries, "right", entries.at("m2"), Find(entries, "d2"), size));
  const Entry *rotation = Find(entries, "r"), *translation = Find(entries, "t");
  if (rotation && translation) {
    rig.cameras[1].cam_from_world = ReadStereo(*rotation, *translation, options.metres_per_unit);
    imported->notes.push_back(
        {"CAL-UNIT", "the file names no unit; T is taken as " + std::to_string(options.metres_per_unit) + " m per unit",
         "pass --unit mm, cm or m: that of the board's squares"});
  } else {
    imported->notes.push_back({"CAL-NOPOSE", "the file has no R and T: both cameras stand at the origin",
                               "give the file with R and T as well: calib convert intrinsics.yml extrinsics.yml"});
  }
}

}  // namespace

ImportedRig ReadOpenCvYaml(const std::vector<std::string>& paths, const OpenCvOptions& options) {
  if (paths.empty()) throw UsageError("no OpenCV file given");
  Entries entries;
  for (const std::string& path : paths) ReadEntries(path, &entries);
  ImportedRig imported;
  const Entry* single = FindFirst(entries, {"cameramatrix", "k"});
  if (entries.count("m1") && entries.count("m2")) {
    imported.rig.gauge = "camera left";
    AddStereo(entries, ReadSize(entries, paths.front(), options), options, &imported);
  } else if (single) {
    imported.rig.gauge = "camera camera";
    const Entry* distortion = FindFirst(entries, {"distortioncoefficients", "distcoeffs", "d"});
    imported.rig.cameras.push_back(
        ReadCamera(entries, "camera", *single, distortion, ReadSize(entries, paths.front(), options)));
  } else {
    throw FormatError(paths.front(), "", "no calibration in it: neither camera_matrix nor M1 and M2");
  }
  return imported;
}

}  // namespace mvstudio::calib
