#include <algorithm>
#include <cmath>
#include <cstring>

#include "body/skeleton.h"
#include "core/format.h"
#include "exports/joint_files.h"

/// C3D, https://www.c3d.org/HTML/: Intel byte order, points as 32-bit floats in millimetres, z up.
namespace mvstudio::exports {
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

std::string ParameterSection(const std::vector<int>& frames, double rate_hz, int data_block) {
  const std::vector<std::string>& joints = body::Coco19().joints;
  const int first = frames.front() + 1, last = frames.back() + 1;
  Parameters p;
  p.Group("POINT");
  p.Ints("USED", {static_cast<int>(joints.size())});
  p.Float("SCALE", kScale);
  p.Float("RATE", static_cast<float>(rate_hz));
  p.Ints("DATA_START", {data_block});
  p.Ints("FRAMES", {std::min(static_cast<int>(frames.size()), 65535)});
  p.Float("LONG_FRAMES", static_cast<float>(frames.size()));
  p.Texts("LABELS", joints);
  p.Texts("DESCRIPTIONS", joints);
  p.Text("UNITS", "mm");
  p.Text("X_SCREEN", "+X");
  p.Text("Y_SCREEN", "+Z");
  p.Group("TRIAL");
  p.Ints("ACTUAL_START_FIELD", {first & 0xffff, first >> 16});
  p.Ints("ACTUAL_END_FIELD", {last & 0xffff, last >> 16});
  p.Float("CAMERA_RATE", static_cast<float>(rate_hz));
  p.Group("ANALOG");
  p.Ints("USED", {0});
  p.Float("GEN_SCALE", 1);
  p.Float("RATE", 0);
  p.Group("FORCE_PLATFORM");
  p.Ints("USED", {0});
  return p.Bytes();
}

std::string Header(const std::vector<int>& frames, double rate_hz, int data_block) {
  std::string bytes("\x02", 1);  // the parameters start at block 2
  Append<uint8_t>(kSignature, &bytes);
  Append<uint16_t>(19, &bytes);
  Append<uint16_t>(0, &bytes);
  Append<uint16_t>(static_cast<uint16_t>(std::min(frames.front() + 1, 65535)), &bytes);
  Append<uint16_t>(static_cast<uint16_t>(std::min(frames.back() + 1, 65535)), &bytes);
  Append<uint16_t>(0, &bytes);
  Append<float>(kScale, &bytes);
  Append<uint16_t>(static_cast<uint16_t>(data_block), &bytes);
  Append<uint16_t>(0, &bytes);
  Append<float>(static_cast<float>(rate_hz), &bytes);
  PadToBlock(&bytes);
  return bytes;
}

/// x, y, z, residual of each joint; a residual of -1 says that there is no point.
std::string Points(const Take& take, int person, const std::vector<int>& frames) {
  std::string bytes;
  for (const int frame : frames) {
    const dataset::Coco19Pose* pose = PoseOf(take, frame, person);
    for (int j = 0; j < 19; ++j) {
      const bool valid = pose && pose->valid[j];
      for (int k = 0; k < 3; ++k) Append<float>(valid ? static_cast<float>(1000 * pose->x_in_world(k, j)) : 0, &bytes);
      Append<float>(valid ? 0 : -1, &bytes);
    }
  }
  PadToBlock(&bytes);
  return bytes;
}

}  // namespace

void WriteC3d(const Job& job) {
  RequirePeople(job);
  const std::vector<int> frames = ContinuousFrames(job.take);
  const int blocks = static_cast<int>(ParameterSection(frames, job.take.frame_rate_hz, 0).size() / kBlock);
  const int data_block = 2 + blocks;
  for (const int person : job.take.PersonIds()) {
    job.Write(PersonFile(job.take, person, ".c3d"), Header(frames, job.take.frame_rate_hz, data_block) +
                                                        ParameterSection(frames, job.take.frame_rate_hz, data_block) +
                                                        Points(job.take, person, frames));
  }
  const double rounding_mm = 1000 * FloatRoundingM(job.take);
  job.report->figures.emplace_back("max_rounding_mm", rounding_mm);
  constexpr double kWorthSayingMm = 0.05;
  if (rounding_mm > kWorthSayingMm) {
    const std::string text =
        Format("C3D holds single-precision numbers: joints move by up to %.2g mm so far from the origin", rounding_mm);
    job.report->notes.push_back({"EXP-ROUNDED", text, "export trc, csv or npz, or move the world's origin near the people"});
  }
}

}  // namespace mvstudio::exports
