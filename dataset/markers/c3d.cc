#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "dataset/markers/marker_files.h"
#include "dataset/pose/markers.h"

/// C3D, https://www.c3d.org/HTML/: Intel byte order, points as 32-bit floats in millimetres, in the axes of the world.
namespace mvstudio::markers {
namespace {

constexpr size_t kBlock = 512;
constexpr uint8_t kSignature = 0x50, kIntel = 84;
constexpr float kScale = -1;  // negative: the points are floats

template <class T>
void Append(T value, std::string* bytes) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes->append(raw, sizeof(T));
}

void PadToBlock(std::string* bytes) { bytes->append((kBlock - bytes->size() % kBlock) % kBlock, '\0'); }

/// The parameter section, put together entry by entry.
class Parameters {
 public:
  void Group(const std::string& name) {
    ++group_;
    Entry(-group_, name, std::string("\0", 1));
  }
  void Ints(const std::string& name, const std::vector<int>& values) {
    std::string data;
    for (const int value : values) Append<uint16_t>(static_cast<uint16_t>(value), &data);
    Value(name, 2, values.size() == 1 ? std::vector<size_t>() : std::vector<size_t>{values.size()}, data);
  }
  void Float(const std::string& name, float value) {
    std::string data;
    Append<float>(value, &data);
    Value(name, 4, {}, data);
  }
  void Texts(const std::string& name, const std::vector<std::string>& texts) {
    size_t longest = 1;
    for (const std::string& text : texts) longest = std::max(longest, text.size());
    std::string data;
    for (std::string text : texts) {
      text.resize(longest, ' ');
      data += text;
    }
    Value(name, -1, {longest, texts.size()}, data);
  }
  void Text(const std::string& name, const std::string& text) { Value(name, -1, {text.size()}, text); }

  /// With its own header, padded to whole blocks.
  std::string Bytes() const {
    std::string bytes("\x01", 1);
    Append<uint8_t>(kSignature, &bytes);
    const size_t size = 4 + entries_.size() + 2;
    Append<uint8_t>(static_cast<uint8_t>((size + kBlock - 1) / kBlock), &bytes);
    Append<uint8_t>(kIntel, &bytes);
    bytes += entries_ + std::string(2, '\0');
    PadToBlock(&bytes);
    return bytes;
  }

 private:
  void Value(const std::string& name, int type, const std::vector<size_t>& dimensions, const std::string& data) {
    std::string content;
    Append<int8_t>(static_cast<int8_t>(type), &content);
    Append<uint8_t>(static_cast<uint8_t>(dimensions.size()), &content);
    for (const size_t n : dimensions) Append<uint8_t>(static_cast<uint8_t>(n), &content);
    Entry(group_, name, content + data + std::string("\0", 1));
  }
  /// Name length, group, name, distance to the next entry, content.
  void Entry(int group, const std::string& name, const std::string& content) {
    Append<int8_t>(static_cast<int8_t>(name.size()), &entries_);
    Append<int8_t>(static_cast<int8_t>(group), &entries_);
    entries_ += name;
    Append<uint16_t>(static_cast<uint16_t>(content.size() + 2), &entries_);
    entries_ += content;
  }

  std::string entries_;
  int group_ = 0;
};

std::string ParameterSection(const MarkerTake& take, int data_block, const std::string& up) {
  const int first = take.first_frame + 1, last = take.first_frame + take.num_frames();
  Parameters p;
  p.Group("POINT");
  p.Ints("USED", {take.num_markers()});
  p.Float("SCALE", kScale);
  p.Float("RATE", static_cast<float>(take.rate_hz));
  p.Ints("DATA_START", {data_block});
  p.Ints("FRAMES", {std::min(take.num_frames(), 65535)});
  p.Float("LONG_FRAMES", static_cast<float>(take.num_frames()));
  p.Texts("LABELS", take.names);
  p.Texts("DESCRIPTIONS", take.names);
  p.Text("UNITS", "mm");
  p.Text("X_SCREEN", up == "x" ? "+Y" : "+X");
  p.Text("Y_SCREEN", up == "y" ? "+Y" : up == "x" ? "+X" : "+Z");
  p.Group("TRIAL");
  p.Ints("ACTUAL_START_FIELD", {first & 0xffff, first >> 16});
  p.Ints("ACTUAL_END_FIELD", {last & 0xffff, last >> 16});
  p.Float("CAMERA_RATE", static_cast<float>(take.rate_hz));
  p.Group("ANALOG");
  p.Ints("USED", {0});
  p.Float("GEN_SCALE", 1);
  p.Float("RATE", 0);
  p.Group("FORCE_PLATFORM");
  p.Ints("USED", {0});
  return p.Bytes();
}

std::string Header(const MarkerTake& take, int data_block) {
  std::string bytes("\x02", 1);  // the parameters start at block 2
  Append<uint8_t>(kSignature, &bytes);
  Append<uint16_t>(static_cast<uint16_t>(take.num_markers()), &bytes);
  Append<uint16_t>(0, &bytes);
  Append<uint16_t>(static_cast<uint16_t>(std::min(take.first_frame + 1, 65535)), &bytes);
  Append<uint16_t>(static_cast<uint16_t>(std::min(take.first_frame + take.num_frames(), 65535)), &bytes);
  Append<uint16_t>(0, &bytes);
  Append<float>(kScale, &bytes);
  Append<uint16_t>(static_cast<uint16_t>(data_block), &bytes);
  Append<uint16_t>(0, &bytes);
  Append<float>(static_cast<float>(take.rate_hz), &bytes);
  PadToBlock(&bytes);
  return bytes;
}

/// x, y, z, residual of each marker. Residuals: -1 no point, 0 not measured, else the deviation in mm.
std::string Points(const MarkerTake& take, const std::string& up) {
  std::string bytes;
  for (size_t i = 0; i < take.source.size(); ++i) {
    const bool has = take.source[i] != Source::kMissing;
    const Eigen::Vector3d x_mm = 1000 * dataset::AxesFromWorld(take.x_in_world[i], up);
    for (int k = 0; k < 3; ++k) Append<float>(has ? static_cast<float>(x_mm[k]) : 0, &bytes);
    const float sigma_mm = take.source[i] == Source::kMeasured ? static_cast<float>(1000 * take.sigma_m[i]) : 0;
    Append<float>(has ? sigma_mm : -1, &bytes);
  }
  PadToBlock(&bytes);
  return bytes;
}

}  // namespace

std::string C3dBytes(const MarkerTake& take, const std::string& up) {
  constexpr int kMostMarkers = 255;  // a dimension of a parameter is one byte
  if (take.num_markers() > kMostMarkers) {
    throw UsageError("C3D holds " + std::to_string(kMostMarkers) + " markers, these are " + std::to_string(take.num_markers()) +
                     "; write trc or csv");
  }
  const int data_block = 2 + static_cast<int>(ParameterSection(take, 0, up).size() / kBlock);
  return Header(take, data_block) + ParameterSection(take, data_block, up) + Points(take, up);
}

}  // namespace mvstudio::markers
