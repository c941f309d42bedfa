#include "calib/formats/colmap_files.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>

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
    model->doubts.push_back(path + " states " + std::to_string(stated) + " " + of_what + " and holds " + std::to_string(read));
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
    image.rotation = ColmapRotation(values[0], values[1], values[2], values[3], place);
    image.translation = {values[4], values[5], values[6]};
    image.camera_id = Id(words[8], place);
    for (size_t i = 9; i < words.size(); ++i) image.name += (i > 9 ? " " : "") + words[i];
    model->images.push_back(image);
    std::getline(lines, line), ++number;  // its points
  }
  CheckCount(path, "images", stated, model->images.size(), model);
}

/// RIG_ID NUM_SENSORS REF_TYPE REF_ID, then TYPE ID HAS_POSE [QW QX QY QZ TX TY TZ] of each other sensor.
void ReadTextRigs(const std::string& path, ColmapFiles* model) {
  std::istringstream lines(ReadFile(path));
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    const Place place{path, "line " + std::to_string(++number)};
    const std::vector<std::string> words = Words(line);
    if (words.empty() || words[0][0] == '#') continue;
    const auto word = [&](size_t i) -> const std::string& {
      if (i >= words.size()) throw FormatError(path, place.where, "the line ends too early; is the file truncated?");
      return words[i];
    };
    std::vector<ColmapSensor> rig;
    size_t at = 2;
    for (uint32_t left = Id(word(1), place), first = left; left > 0; --left) {
      const bool reference = left == first, camera = word(at) == "CAMERA";
      ColmapSensor sensor{Id(word(at + 1), place), geometry::Rigid3()};
      at += 2;
      if (!reference && word(at++) == "0") sensor.sensor_from_rig.reset();
      if (!reference && sensor.sensor_from_rig) {
        double values[7];
        for (double& value : values) value = ParseNumber(word(at++), place);
        sensor.sensor_from_rig = {ColmapRotation(values[0], values[1], values[2], values[3], place),
                                  {values[4], values[5], values[6]}};
      }
      if (camera) rig.push_back(sensor);
    }
    model->rigs.push_back(std::move(rig));
  }
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

/// The same numbers; a type is 0 for a camera.
void ReadBinaryRigs(const std::string& path, ColmapFiles* model) {
  BinaryReader in(path);
  for (uint64_t left = in.Count(8); left > 0; --left) {
    std::vector<ColmapSensor> rig;
    in.Read<uint32_t>();
    const uint32_t count = in.Read<uint32_t>();
    for (uint32_t i = 0; i < count; ++i) {
      const bool camera = in.Read<int32_t>() == 0;
      ColmapSensor sensor{in.Read<uint32_t>(), geometry::Rigid3()};
      if (i > 0 && in.Read<uint8_t>() == 0) sensor.sensor_from_rig.reset();
      if (i > 0 && sensor.sensor_from_rig) {
        double values[7];
        for (double& value : values) value = in.Number();
        sensor.sensor_from_rig = {ColmapRotation(values[0], values[1], values[2], values[3], in.Here()),
                                  {values[4], values[5], values[6]}};
      }
      if (camera) rig.push_back(sensor);
    }
    model->rigs.push_back(std::move(rig));
  }
  in.RequireEnd();
}

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
    in.Read<uint32_t>();
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

template <class T>
void Append(T value, std::string* bytes) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes->append(raw, sizeof(T));
}

std::vector<double> PoseNumbers(const ColmapImage& image) {
  const Eigen::Quaterniond& q = image.rotation;
  return {q.w(), q.x(), q.y(), q.z(), image.translation.x(), image.translation.y(), image.translation.z()};
}

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

}  // namespace

ColmapFiles ReadColmapText(const std::string& folder) {
  ColmapFiles model;
  ReadTextCameras(folder + "/cameras.txt", &model);
  ReadTextImages(folder + "/images.txt", &model);
  if (std::filesystem::exists(folder + "/rigs.txt")) ReadTextRigs(folder + "/rigs.txt", &model);
  return model;
}

ColmapFiles ReadColmapBinary(const std::string& folder) {
  ColmapFiles model;
  ReadBinaryCameras(folder + "/cameras.bin", &model);
  ReadBinaryImages(folder + "/images.bin", &model);
  if (std::filesystem::exists(folder + "/rigs.bin")) ReadBinaryRigs(folder + "/rigs.bin", &model);
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
  std::string images =
      "# Image list with two lines of data per image:\n"
      "#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n#   POINTS2D[] as (X, Y, POINT3D_ID)\n"
      "# Number of images: " +
      count + "\n";
  for (const ColmapImage& image : model.images) {
    images += std::to_string(image.camera_id);
    for (const double value : PoseNumbers(image)) images += " " + NumberText(value);
    images += " " + std::to_string(image.camera_id) + " " + image.name + "\n";
    std::string features;
    for (const ColmapImage::Feature& feature : image.features) {
      features += (features.empty() ? "" : " ") + NumberText(feature.px_from_corner.x()) + " " +
                  NumberText(feature.px_from_corner.y()) + " " + std::to_string(feature.point_id);
    }
    images += features + "\n";
  }
  WriteFileAtomic(folder + "/cameras.txt", cameras);
  WriteFileAtomic(folder + "/images.txt", images);
  WriteFileAtomic(folder + "/points3D.txt", PointsText(model));
  return {folder + "/cameras.txt", folder + "/images.txt", folder + "/points3D.txt"};
}

Files WriteColmapBinary(const ColmapFiles& model, const std::string& folder) {
  std::string cameras, images, points;
  Append<uint64_t>(model.cameras.size(), &cameras);
  for (const auto& [id, camera] : model.cameras) {
    Append<uint32_t>(id, &cameras);
    Append<int32_t>(camera.model->id, &cameras);
    Append<uint64_t>(static_cast<uint64_t>(camera.width_px), &cameras);
    Append<uint64_t>(static_cast<uint64_t>(camera.height_px), &cameras);
    for (const double param : camera.params) Append<double>(param, &cameras);
  }
  Append<uint64_t>(model.images.size(), &images);
  for (const ColmapImage& image : model.images) {
    Append<uint32_t>(image.camera_id, &images);
    for (const double value : PoseNumbers(image)) Append<double>(value, &images);
    Append<uint32_t>(image.camera_id, &images);
    images += image.name + '\0';
    Append<uint64_t>(image.features.size(), &images);
    for (const ColmapImage::Feature& feature : image.features) {
      Append<double>(feature.px_from_corner.x(), &images);
      Append<double>(feature.px_from_corner.y(), &images);
      Append<uint64_t>(feature.point_id, &images);
    }
  }
  AppendPoints(model, &points);
  WriteFileAtomic(folder + "/cameras.bin", cameras);
  WriteFileAtomic(folder + "/images.bin", images);
  WriteFileAtomic(folder + "/points3D.bin", points);
  return {folder + "/cameras.bin", folder + "/images.bin", folder + "/points3D.bin"};
}

}  // namespace mvstudio::calib::internal
