#include "calib/formats/colmap/colmap_files.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>

#include "calib/formats/colmap/colmap_rigs.h"
#include "core/disk/files.h"
#include "core/error.h"

namespace mvstudio::calib::internal {
namespace {

std::vector<std::string> Words(const std::string& line) {
  std::istringstream stream(line);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

uint32_t Id(const std::string& word, const Place& place) {
  const double number = ParseNumber(word, place);
  if (!(number >= 0 && number < 4294967295.0) || number != std::floor(number)) {
    throw FormatError(place.path, place.where, "'" + Printable(word) + "' is not an id");
  }
  return static_cast<uint32_t>(number);
}

void AddColmapCamera(uint32_t id, ColmapCamera camera, ColmapFiles* model) {
  const Place place = camera.place;
  if (!model->cameras.emplace(id, std::move(camera)).second) {
    throw FormatError(place.path, place.where, "camera " + std::to_string(id) + " occurs twice");
  }
}

/// The N of a comment "# Number of images: N, mean observations per image: M"; -1: another line.
long StatedCount(const std::string& line, const std::string& of_what) {
  const std::string head = "# Number of " + of_what + ": ";
  return line.rfind(head, 0) == 0 ? std::strtol(line.c_str() + head.size(), nullptr, 10) : -1;
}

void CheckCount(const std::string& path, const std::string& of_what, long stated, size_t read, ColmapFiles* model) {
  if (stated >= 0 && static_cast<size_t>(stated) != read)
    model->conflicts.push_back(path + " states " + std::to_string(stated) + " " + of_what + " and holds " +
                               std::to_string(read));
}

void ReadTextCameras(const std::string& path, ColmapFiles* model) {
  std::istringstream lines(ReadFile(path));
  int number = 0;
  long stated = -1;
  for (std::string line; std::getline(lines, line);) {
    const Place place{path, "line " + std::to_string(++number)};
    stated = std::max(stated, StatedCount(line, "cameras"));
    const std::vector<std::string> words = Words(line);
    if (words.empty() || words[0][0] == '#') continue;
    if (words.size() < 4) throw FormatError(path, place.where, "'CAMERA_ID MODEL WIDTH HEIGHT PARAMS' was expected");
    ColmapCamera camera{FindColmapModel(words[1]), ParseNumber(words[2], place), ParseNumber(words[3], place), {}, place};
    if (!camera.model) throw FormatError(path, place.where, "the lens '" + Printable(words[1]) + "' is not known here");
    if (words.size() != 4 + static_cast<size_t>(camera.model->num_params)) {
      throw FormatError(path, place.where,
                        std::to_string(words.size() - 4) + " lens parameters, " + std::to_string(camera.model->num_params) +
                            " expected for " + camera.model->name);
    }
    for (size_t i = 4; i < words.size(); ++i) camera.params.push_back(ParseNumber(words[i], place));
    AddColmapCamera(Id(words[0], place), std::move(camera), model);
  }
  CheckCount(path, "cameras", stated, model->cameras.size(), model);
}

void ReadTextImages(const std::string& path, ColmapFiles* model) {
  std::istringstream lines(ReadFile(path));
  int number = 0;
  long stated = -1;
  for (std::string line; std::getline(lines, line);) {
    const Place place{path, "line " + std::to_string(++number)};
    stated = std::max(stated, StatedCount(line, "images"));
    const std::vector<std::string> words = Words(line);
    if (words.empty() || words[0][0] == '#') continue;
    if (words.size() < 10) {
      throw FormatError(path, place.where,
                        "'IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME' was expected; is the file truncated?");
    }
    double values[7];
    for (size_t i = 0; i < 7; ++i) values[i] = ParseNumber(words[i + 1], place);
    ColmapImage image;
    image.place = place;
    image.id = Id(words[0], place);
    image.rotation = ColmapRotation(values[0], values[1], values[2], values[3], place);
    image.translation = {values[4], values[5], values[6]};
    image.camera_id = Id(words[8], place);
    for (size_t i = 9; i < words.size(); ++i) image.name += (i > 9 ? " " : "") + words[i];
    model->images.push_back(image);
    if (!std::getline(lines, line)) line.clear();
    if (Words(line).size() % 3 != 0)  // its points
      throw FormatError(path, "line " + std::to_string(number + 1),
                        "the points of image " + Printable(image.name) +
                            " were expected, three numbers each, or an empty line: an image has two lines");
    ++number;
  }
  CheckCount(path, "images", stated, model->images.size(), model);
}

/// The words of a line one after the other; see colmap_rigs.h.
class WordReader {
 public:
  WordReader(const std::string& line, Place place) : words_(Words(line)), place_(std::move(place)) {}

  uint32_t Id() { return internal::Id(Next(), place_); }
  uint64_t DataId() { return Id(); }
  bool IsCamera() { return Next() == "CAMERA"; }
  bool Flag() { return Next() != "0"; }
  double Number() { return ParseNumber(Next(), place_); }
  Place Here() const { return place_; }
  void RequireEnd() const {
    if (at_ != words_.size()) throw FormatError(place_.path, place_.where, "the line holds more than it states");
  }

 private:
  const std::string& Next() {
    if (at_ >= words_.size()) throw FormatError(place_.path, place_.where, "the line ends too early; is the file truncated?");
    return words_[at_++];
  }

  std::vector<std::string> words_;
  Place place_;
  size_t at_ = 0;
};

/// Calls read(WordReader*) for each line that is no comment, and holds their number against the stated one.
template <class ReadLine>
void ReadTextLines(const std::string& path, const char* of_what, ColmapFiles* model, const ReadLine& read) {
  std::istringstream lines(ReadFile(path));
  int number = 0;
  long stated = -1;
  size_t found = 0;
  for (std::string line; std::getline(lines, line); ++number) {
    stated = std::max(stated, StatedCount(line, of_what));
    const size_t first = line.find_first_not_of(" \t\r");
    if (first == std::string::npos || line[first] == '#') continue;
    WordReader words(line, {path, "line " + std::to_string(number + 1)});
    read(&words);
    words.RequireEnd();
    ++found;
  }
  CheckCount(path, of_what, stated, found, model);
}

/// Reads little-endian numbers; every read is checked against the end.
class BinaryReader {
 public:
  explicit BinaryReader(const std::string& path) : path_(path), bytes_(ReadFile(path)) {}

  template <class T>
  T Read() {
    if (bytes_.size() - position_ < sizeof(T)) Truncated();
    T value;
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return value;
  }
  double Number() {
    const double value = Read<double>();
    if (!std::isfinite(value)) throw FormatError(path_, Here().where, "a number is not finite");
    return value;
  }
  std::string Text() {
    const size_t end = bytes_.find('\0', position_);
    if (end == std::string::npos) Truncated();
    const std::string text = bytes_.substr(position_, end - position_);
    position_ = end + 1;
    return text;
  }
  void Skip(uint64_t count, uint64_t size) {
    if (count > (bytes_.size() - position_) / size) Truncated();
    position_ += static_cast<size_t>(count * size);
  }
  // See colmap_rigs.h; a type is 0 for a camera.
  uint32_t Id() { return Read<uint32_t>(); }
  uint64_t DataId() { return Read<uint64_t>(); }
  bool IsCamera() { return Read<int32_t>() == 0; }
  bool Flag() { return Read<uint8_t>() != 0; }
  /// A count of entries of at least `size` bytes each.
  uint64_t Count(uint64_t size) {
    const uint64_t count = Read<uint64_t>();
    if (count > (bytes_.size() - position_) / size) Truncated();
    return count;
  }
  Place Here() const { return {path_, "byte " + std::to_string(position_)}; }
  void RequireEnd() const {
    if (position_ != bytes_.size()) throw FormatError(path_, Here().where, "nothing was expected after the last entry");
  }

 private:
  [[noreturn]] void Truncated() const { throw FormatError(path_, Here().where, "the file ends here; is it truncated?"); }

  const std::string path_, bytes_;
  size_t position_ = 0;
};

void ReadBinaryCameras(const std::string& path, ColmapFiles* model) {
  BinaryReader in(path);
  for (uint64_t left = in.Count(24 + 3 * 8); left > 0; --left) {
    ColmapCamera camera;
    camera.place = in.Here();
    const uint32_t id = in.Read<uint32_t>();
    const int model_id = in.Read<int32_t>();
    camera.model = FindColmapModel(model_id);
    if (!camera.model)
      throw FormatError(path, camera.place.where, "lens model " + std::to_string(model_id) + " is not known here");
    camera.width_px = static_cast<double>(in.Read<uint64_t>());
    camera.height_px = static_cast<double>(in.Read<uint64_t>());
    for (int i = 0; i < camera.model->num_params; ++i) camera.params.push_back(in.Number());
    AddColmapCamera(id, std::move(camera), model);
  }
  in.RequireEnd();
}

void ReadBinaryImages(const std::string& path, ColmapFiles* model) {
  BinaryReader in(path);
  for (uint64_t left = in.Count(4 + 7 * 8 + 4 + 1 + 8); left > 0; --left) {
    ColmapImage image;
    image.place = in.Here();
    image.id = in.Read<uint32_t>();
    double values[7];
    for (double& value : values) value = in.Number();
    image.rotation = ColmapRotation(values[0], values[1], values[2], values[3], image.place);
    image.translation = {values[4], values[5], values[6]};
    image.camera_id = in.Read<uint32_t>();
    image.name = in.Text();
    in.Skip(in.Read<uint64_t>(), 24);
    model->images.push_back(image);
  }
  in.RequireEnd();
}

geometry::Rigid3 PoseOf(const ColmapImage& image) { return {image.rotation, image.translation}; }

std::string PointsText(const ColmapFiles& model) {
  std::string text =
      "# 3D point list with one line of data per point:\n#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, "
      "POINT2D_IDX)\n# Number of points: " +
      std::to_string(model.points.size()) + "\n";
  for (size_t i = 0; i < model.points.size(); ++i) {
    const ColmapPoint& point = model.points[i];
    text += std::to_string(i + 1);
    for (int k = 0; k < 3; ++k) text += " " + NumberText(point.x_in_world[k]);
    for (const uint8_t channel : point.rgb) text += " " + std::to_string(channel);
    text += " " + NumberText(point.error_px);
    for (const auto& [image, feature] : point.track) text += " " + std::to_string(image) + " " + std::to_string(feature);
    text += "\n";
  }
  return text;
}

void AppendPoints(const ColmapFiles& model, std::string* bytes) {
  Append<uint64_t>(model.points.size(), bytes);
  for (size_t i = 0; i < model.points.size(); ++i) {
    const ColmapPoint& point = model.points[i];
    Append<uint64_t>(i + 1, bytes);
    for (int k = 0; k < 3; ++k) Append<double>(point.x_in_world[k], bytes);
    for (const uint8_t channel : point.rgb) Append<uint8_t>(channel, bytes);
    Append<double>(point.error_px, bytes);
    Append<uint64_t>(point.track.size(), bytes);
    for (const auto& [image, feature] : point.track) {
      Append<uint32_t>(image, bytes);
      Append<uint32_t>(feature, bytes);
    }
  }
}

Files WriteAll(const std::string& folder, const char* extension, const std::array<std::string, 5>& contents) {
  constexpr const char* kNames[] = {"/cameras", "/images", "/rigs", "/frames", "/points3D"};
  Files files;
  for (size_t i = 0; i < contents.size(); ++i) {
    files.push_back(folder + kNames[i] + extension);
    WriteFileAtomic(files.back(), contents[i]);
  }
  return files;
}

}  // namespace

ColmapFiles ReadColmapText(const std::string& folder) {
  ColmapFiles model;
  ReadTextCameras(folder + "/cameras.txt", &model);
  ReadTextImages(folder + "/images.txt", &model);
  if (std::filesystem::exists(folder + "/rigs.txt"))
    ReadTextLines(folder + "/rigs.txt", "rigs", &model, [&](WordReader* in) { model.rigs.push_back(ReadRig(in)); });
  if (std::filesystem::exists(folder + "/frames.txt"))
    ReadTextLines(folder + "/frames.txt", "frames", &model, [&](WordReader* in) { model.frames.push_back(ReadFrame(in)); });
  return model;
}

ColmapFiles ReadColmapBinary(const std::string& folder) {
  ColmapFiles model;
  ReadBinaryCameras(folder + "/cameras.bin", &model);
  ReadBinaryImages(folder + "/images.bin", &model);
  if (std::filesystem::exists(folder + "/rigs.bin")) {
    BinaryReader in(folder + "/rigs.bin");
    for (uint64_t left = in.Count(4 + 4); left > 0; --left) model.rigs.push_back(ReadRig(&in));
    in.RequireEnd();
  }
  if (std::filesystem::exists(folder + "/frames.bin")) {
    BinaryReader in(folder + "/frames.bin");
    for (uint64_t left = in.Count(4 + 4 + 7 * 8 + 4); left > 0; --left) model.frames.push_back(ReadFrame(&in));
    in.RequireEnd();
  }
  return model;
}

Files WriteColmapText(const ColmapFiles& model, const std::string& folder) {
  const std::string count = std::to_string(model.images.size());
  std::string cameras =
      "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
      "# Number of cameras: " +
      count + "\n";
  for (const auto& [id, camera] : model.cameras) {
    cameras += std::to_string(id) + " " + camera.model->name + " " + std::to_string(static_cast<int>(camera.width_px)) + " " +
               std::to_string(static_cast<int>(camera.height_px));
    for (const double param : camera.params) cameras += " " + NumberText(param);
    cameras += "\n";
  }
  TextSink images{
      "# Image list with two lines of data per image:\n"
      "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n#   POINTS2D[] as (X, Y, POINT3D_ID)\n"
      "# Number of images: " +
      count + "\n"};
  for (const ColmapImage& image : model.images) {
    images.Id(image.id), WritePose(PoseOf(image), &images), images.Id(image.camera_id), images.Word(image.name + "\n");
    for (const ColmapImage::Feature& feature : image.features) {
      images.Number(feature.px_from_corner.x()), images.Number(feature.px_from_corner.y());
      images.DataId(feature.point_id);
    }
    images.text += "\n";
  }
  TextSink rigs{
      "# Rig calib list with one line of data per calib:\n#   RIG_ID, NUM_SENSORS, REF_SENSOR_TYPE, REF_SENSOR_ID, "
      "SENSORS[] as (SENSOR_TYPE, SENSOR_ID, HAS_POSE, [QW, QX, QY, QZ, TX, TY, TZ])\n# Number of rigs: " +
      std::to_string(model.rigs.size()) + "\n"};
  for (const ColmapRig& rig : model.rigs) WriteRig(rig, &rigs), rigs.text += "\n";
  TextSink frames{
      "# Frame list with one line of data per frame:\n#   FRAME_ID, RIG_ID, RIG_FROM_WORLD[QW, QX, QY, QZ, TX, TY, TZ], "
      "NUM_DATA_IDS, DATA_IDS[] as (SENSOR_TYPE, SENSOR_ID, DATA_ID)\n# Number of frames: " +
      std::to_string(model.frames.size()) + "\n"};
  for (const ColmapFrame& frame : model.frames) WriteFrame(frame, model, &frames), frames.text += "\n";
  return WriteAll(folder, ".txt", {cameras, images.text, rigs.text, frames.text, PointsText(model)});
}

Files WriteColmapBinary(const ColmapFiles& model, const std::string& folder) {
  std::string cameras, points;
  Append<uint64_t>(model.cameras.size(), &cameras);
  for (const auto& [id, camera] : model.cameras) {
    Append<uint32_t>(id, &cameras);
    Append<int32_t>(camera.model->id, &cameras);
    Append<uint64_t>(static_cast<uint64_t>(camera.width_px), &cameras);
    Append<uint64_t>(static_cast<uint64_t>(camera.height_px), &cameras);
    for (const double param : camera.params) Append<double>(param, &cameras);
  }
  ByteSink images, rigs, frames;
  images.DataId(model.images.size());
  for (const ColmapImage& image : model.images) {
    images.Id(image.id), WritePose(PoseOf(image), &images), images.Id(image.camera_id);
    images.bytes += image.name + '\0';
    images.DataId(image.features.size());
    for (const ColmapImage::Feature& feature : image.features) {
      images.Number(feature.px_from_corner.x()), images.Number(feature.px_from_corner.y());
      images.DataId(feature.point_id);
    }
  }
  rigs.DataId(model.rigs.size()), frames.DataId(model.frames.size());
  for (const ColmapRig& rig : model.rigs) WriteRig(rig, &rigs);
  for (const ColmapFrame& frame : model.frames) WriteFrame(frame, model, &frames);
  AppendPoints(model, &points);
  return WriteAll(folder, ".bin", {cameras, images.bytes, rigs.bytes, frames.bytes, points});
}

}  // namespace mvstudio::calib::internal
