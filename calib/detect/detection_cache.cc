#include "calib/detect/detection_cache.h"

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <type_traits>

#include "core/disk/files.h"
#include "core/disk/paths.h"
#include "core/disk/trace.h"
#include "core/error.h"
#include "core/fields.h"
#include "core/hash/sha256.h"
#include "core/join.h"
#include "core/log.h"

namespace mvstudio::calib {
namespace {

namespace fs = std::filesystem;

/// To be raised whenever detection gives other results than before.
constexpr char kDetectorVersion[] = "mvstudio detections 7";
constexpr size_t kDigestSize = 64;
constexpr uint64_t kMaxCount = 1u << 26;

constexpr char kAuto[] = "auto", kOff[] = "off";

/// "off" or a folder.
std::string FromEnvironment() {
  const auto get = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value ? value : "");
  };
  if (const std::string chosen = get("MVSTUDIO_CACHE"); !chosen.empty()) return chosen;
  if (const std::string cache = get("XDG_CACHE_HOME"); !cache.empty()) return cache + "/mvstudio";
  const std::string home = get("HOME");
  return home.empty() ? kOff : home + "/.cache/mvstudio";
}

class Writer {
 public:
  template <class T>
  void Put(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
  }
  void Put(const std::string& text) {
    Put<uint64_t>(text.size());
    bytes_ += text;
  }
  void Put(const double* values, Eigen::Index count) {
    Put<uint64_t>(count);
    bytes_.append(reinterpret_cast<const char*>(values), count * sizeof(double));
  }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

struct Damaged {};

class Reader {
 public:
  explicit Reader(std::string_view bytes) : bytes_(bytes) {}

  template <class T>
  T Get() {
    T value;
    std::memcpy(&value, Bytes(sizeof value), sizeof value);
    return value;
  }
  /// A number of items of at least `item_size` bytes that the rest can hold.
  uint64_t Count(size_t item_size) {
    const uint64_t count = Get<uint64_t>();
    if (count > kMaxCount || count * item_size > bytes_.size()) throw Damaged();
    return count;
  }
  std::string Text() {
    const uint64_t size = Count(1);
    return std::string(Bytes(size), size);
  }
  Eigen::VectorXd Values() {
    Eigen::VectorXd values(Count(sizeof(double)));
    if (values.size() > 0) std::memcpy(values.data(), Bytes(values.size() * sizeof(double)), values.size() * sizeof(double));
    return values;
  }
  bool AtEnd() const { return bytes_.empty(); }

 private:
  const char* Bytes(size_t size) {
    if (size > bytes_.size()) throw Damaged();
    const char* at = bytes_.data();
    bytes_.remove_prefix(size);
    return at;
  }
  std::string_view bytes_;
};

void PutDetection(const BoardDetection& d, Writer* out) {
  out->Put<int32_t>(static_cast<int32_t>(d.status));
  out->Put(d.reason);
  out->Put<int32_t>(d.num_found);
  out->Put<double>(d.sigma_px);
  out->Put<int32_t>(d.num_markers);
  out->Put<uint8_t>(d.legacy);
  out->Put<uint8_t>(d.inverted);
  out->Put<double>(d.detection.sigma_px);
  out->Put<uint64_t>(d.detection.corner_ids.size());
  for (int id : d.detection.corner_ids) out->Put<int32_t>(id);
  out->Put(d.detection.points_px.data(), d.detection.points_px.size());
  out->Put(d.detection.sigmas_px.data(), d.detection.sigmas_px.size());
  out->Put<uint8_t>(!d.soft.empty());
  if (!d.soft.empty()) PutDetection(d.soft[0], out);
}

BoardDetection GetDetection(Reader* in, bool is_soft = false) {
  BoardDetection d;
  const int32_t status = in->Get<int32_t>();
  if (status < 0 || status > static_cast<int32_t>(Status::kNotConverged)) throw Damaged();
  d.status = static_cast<Status>(status);
  d.reason = in->Text();
  d.num_found = in->Get<int32_t>();
  d.sigma_px = in->Get<double>();
  d.num_markers = in->Get<int32_t>();
  d.legacy = in->Get<uint8_t>() != 0;
  d.inverted = in->Get<uint8_t>() != 0;
  d.detection.sigma_px = in->Get<double>();
  for (uint64_t n = in->Count(sizeof(int32_t)); n > 0; --n) d.detection.corner_ids.push_back(in->Get<int32_t>());
  const Eigen::VectorXd points = in->Values();
  if (points.size() != 2 * static_cast<Eigen::Index>(d.detection.corner_ids.size())) throw Damaged();
  d.detection.points_px = Eigen::Map<const Eigen::Matrix2Xd>(points.data(), 2, points.size() / 2);
  d.detection.sigmas_px = in->Values();
  if (d.detection.sigmas_px.size() > 0 && d.detection.sigmas_px.size() != points.size() / 2) throw Damaged();
  const bool has_soft = in->Get<uint8_t>() != 0;
  if (has_soft && is_soft) throw Damaged();
  if (has_soft) d.soft.push_back(GetDetection(in, true));
  return d;
}

std::string Encode(const StoredFootage& footage) {
  Writer out;
  out.Put(std::string(kDetectorVersion));
  out.Put<int32_t>(footage.width_px);
  out.Put<int32_t>(footage.height_px);
  out.Put<uint64_t>(footage.pictures.size());
  for (const auto& picture : footage.pictures) {
    out.Put<int64_t>(picture.frame_idx);
    out.Put<uint64_t>(picture.layouts.size());
    for (const BoardDetection& d : picture.layouts) PutDetection(d, &out);
  }
  std::string bytes = out.Take();
  return bytes + Sha256Hex(bytes.data(), bytes.size());
}

StoredFootage Decode(const std::string& bytes) {
  if (bytes.size() < kDigestSize) throw Damaged();
  const size_t size = bytes.size() - kDigestSize;
  if (Sha256Hex(bytes.data(), size) != bytes.substr(size)) throw Damaged();
  Reader in(std::string_view(bytes).substr(0, size));
  if (in.Text() != kDetectorVersion) throw Damaged();
  StoredFootage footage;
  footage.width_px = in.Get<int32_t>();
  footage.height_px = in.Get<int32_t>();
  for (uint64_t n = in.Count(sizeof(int64_t)); n > 0; --n) {
    StoredFootage::Picture picture;
    picture.frame_idx = in.Get<int64_t>();
    for (uint64_t m = in.Count(1); m > 0; --m) picture.layouts.push_back(GetDetection(&in));
    footage.pictures.push_back(std::move(picture));
  }
  if (!in.AtEnd()) throw Damaged();
  return footage;
}

void Add(const std::string& text, Sha256* digest) {
  digest->Update(text.data(), text.size());
  digest->Update("\n", 1);
}

}  // namespace

CachePlace CacheIn(const std::string& folder) { return {CachePlace::Kind::kFolder, folder}; }

std::string ToString(const CachePlace& place) {
  if (place.kind == CachePlace::Kind::kFolder) return place.folder;
  return place.kind == CachePlace::Kind::kAuto ? kAuto : kOff;
}

void FromString(const std::string& text, CachePlace* place) {
  if (text.empty()) throw UsageError("option 'cache' needs auto, off or a folder");
  *place = CacheIn(text);
  if (text == kAuto) *place = {CachePlace::Kind::kAuto, ""};
  if (text == kOff) *place = {CachePlace::Kind::kOff, ""};
}

DetectionCache::DetectionCache(const CachePlace& place) {
  const std::string chosen = place.kind == CachePlace::Kind::kAuto ? FromEnvironment() : ToString(place);
  if (chosen != kOff) folder_ = chosen + "/detections";
}

std::optional<StoredFootage> DetectionCache::Load(const std::string& key) const {
  std::error_code ignored;
  if (!enabled() || !fs::is_regular_file(PathOf(key), ignored)) return std::nullopt;
  const UntracedScope untraced;
  try {
    return Decode(ReadFile(PathOf(key)));
  } catch (const Damaged&) {
    Log(LogLevel::kWarning, PathOf(key) + " is damaged and will be made anew");
  } catch (const Error& error) {
    Log(LogLevel::kWarning, std::string("cached detections cannot be read: ") + error.what());
  }
  return std::nullopt;
}

void DetectionCache::Store(const std::string& key, const StoredFootage& footage) const {
  if (!enabled()) return;
  const UntracedScope untraced;
  try {
    WriteFileAtomic(PathOf(key), Encode(footage));
  } catch (const std::exception& error) {
    Log(LogLevel::kWarning, std::string("detections are not cached: ") + error.what());
  }
}

namespace {

/// What a pattern's wildcards stand for, where that may number the frame otherwise than the whole name does: in a folder's
/// name, or beside digits that the pattern states.
std::string NumberingOf(const std::string& path, const std::string& pattern) {
  const size_t name = path.size() - fs::path(path).filename().string().size();
  std::string wild, stated = path.substr(0, name + fs::path(path).stem().string().size());
  bool in_folder = false;
  for (const auto& [begin, end] : WildSpans(path, pattern)) {
    wild += path.substr(begin, end - begin) + " ";
    in_folder |= begin < name;
    for (size_t i = begin; i < std::min(end, stated.size()); ++i) stated[i] = '*';
  }
  return in_folder || stated.find_first_of("0123456789", name) != std::string::npos ? wild : "";
}

}  // namespace

std::optional<std::string> ContentDigest(const std::string& path_or_pattern) {
  std::error_code ignored;
  std::vector<std::string> files;
  if (fs::is_regular_file(path_or_pattern, ignored)) {
    files = {path_or_pattern};
  } else {
    for (const std::string& path : FilesMatching(path_or_pattern)) {
      if (fs::is_regular_file(path, ignored)) files.push_back(path);
    }
  }
  if (files.empty()) return std::nullopt;
  Sha256 digest;
  for (const std::string& path : IsPattern(path_or_pattern) ? files : std::vector<std::string>()) {
    const std::string numbering = NumberingOf(path, path_or_pattern);
    if (!numbering.empty()) Add(numbering, &digest);
  }
  try {
    for (const std::string& path : files) Add(fs::path(path).filename().string() + " " + Sha256File(path), &digest);
  } catch (const IoError&) {
    return std::nullopt;
  }
  return digest.HexDigest();
}

std::string DetectionKey(const std::string& content_digest, const Board& board, const DetectOptions& options, int stride) {
  Sha256 digest;
  Add(kDetectorVersion, &digest);
  Add("frames by seconds", &digest);  // how names are numbered (dataset/footage/frame_numbers.h)
  Add(content_digest, &digest);
  Add(ToString(board), &digest);
  VisitConstFields(
      [&](const std::string& name, const auto& value, const std::string&) {
        std::ostringstream text;
        text.precision(17);
        text << name << "=";
        if constexpr (kHasWords<std::decay_t<decltype(value)>>) {
          text << ToString(value);
        } else {
          text << value;
        }
        Add(text.str(), &digest);
      },
      options);
  Add("stride " + std::to_string(stride), &digest);
  return digest.HexDigest();
}

}  // namespace mvstudio::calib
