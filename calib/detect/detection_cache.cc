#include "calib/detect/detection_cache.h"

#include <algorithm>
#include <filesystem>

#include "core/disk/kept_key.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/join.h"

namespace mvstudio::calib {
namespace {

namespace fs = std::filesystem;

/// To be raised whenever detection gives other results than before.
constexpr char kDetectorVersion[] = "mvstudio detections 7";

void PutDetection(const BoardDetection& d, KeptWriter* out) {
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
  out->PutAll(d.detection.points_px.data(), d.detection.points_px.size());
  out->PutAll(d.detection.sigmas_px.data(), d.detection.sigmas_px.size());
  out->Put<uint8_t>(!d.soft.empty());
  if (!d.soft.empty()) PutDetection(d.soft[0], out);
}

BoardDetection GetDetection(KeptReader* in, bool is_soft = false) {
  BoardDetection d;
  const int32_t status = in->Get<int32_t>();
  if (status < 0 || status > static_cast<int32_t>(Status::kNotConverged)) throw DamagedBytes();
  d.status = static_cast<Status>(status);
  d.reason = in->Text();
  d.num_found = in->Get<int32_t>();
  d.sigma_px = in->Get<double>();
  d.num_markers = in->Get<int32_t>();
  d.legacy = in->Get<uint8_t>() != 0;
  d.inverted = in->Get<uint8_t>() != 0;
  d.detection.sigma_px = in->Get<double>();
  for (uint64_t n = in->Count(sizeof(int32_t)); n > 0; --n) d.detection.corner_ids.push_back(in->Get<int32_t>());
  const std::vector<double> points = in->All<double>(), sigmas = in->All<double>();
  const size_t corners = d.detection.corner_ids.size();
  if (points.size() != 2 * corners || (!sigmas.empty() && sigmas.size() != corners)) throw DamagedBytes();
  d.detection.points_px = Eigen::Map<const Eigen::Matrix2Xd>(points.data(), 2, static_cast<Eigen::Index>(corners));
  d.detection.sigmas_px = Eigen::Map<const Eigen::VectorXd>(sigmas.data(), static_cast<Eigen::Index>(sigmas.size()));
  const bool has_soft = in->Get<uint8_t>() != 0;
  if (has_soft && is_soft) throw DamagedBytes();
  if (has_soft) d.soft.push_back(GetDetection(in, true));
  return d;
}

std::string Encode(const StoredFootage& footage) {
  KeptWriter out;
  out.Put(std::string(kDetectorVersion));
  out.Put<int32_t>(footage.width_px);
  out.Put<int32_t>(footage.height_px);
  out.Put<uint64_t>(footage.images.size());
  for (const auto& image : footage.images) {
    out.Put<int64_t>(image.frame_idx);
    out.Put<uint64_t>(image.layouts.size());
    for (const BoardDetection& d : image.layouts) PutDetection(d, &out);
  }
  return out.Take();
}

StoredFootage Decode(const std::string& bytes) {
  KeptReader in(bytes);
  if (in.Text() != kDetectorVersion) throw DamagedBytes();
  StoredFootage footage;
  footage.width_px = in.Get<int32_t>();
  footage.height_px = in.Get<int32_t>();
  for (uint64_t n = in.Count(sizeof(int64_t)); n > 0; --n) {
    StoredFootage::DetectedImage image;
    image.frame_idx = in.Get<int64_t>();
    for (uint64_t m = in.Count(1); m > 0; --m) image.layouts.push_back(GetDetection(&in));
    footage.images.push_back(std::move(image));
  }
  if (!in.AtEnd()) throw DamagedBytes();
  return footage;
}

}  // namespace

std::optional<StoredFootage> DetectionCache::Load(const std::string& key) const {
  const std::optional<std::string> bytes = kept_.Load(key);
  if (!bytes) return std::nullopt;
  try {
    return Decode(*bytes);
  } catch (const DamagedBytes&) {
    kept_.Damaged(key);
  }
  return std::nullopt;
}

void DetectionCache::Store(const std::string& key, const StoredFootage& footage) const {
  if (enabled()) kept_.Store(key, Encode(footage));
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
  KeptKey digest;
  for (const std::string& path : IsPattern(path_or_pattern) ? files : std::vector<std::string>()) {
    const std::string numbering = NumberingOf(path, path_or_pattern);
    if (!numbering.empty()) digest.Add(numbering);
  }
  try {
    for (const std::string& path : files) digest.Add(fs::path(path).filename().string() + " " + Sha256File(path));
  } catch (const IoError&) {
    return std::nullopt;
  }
  return digest.Take();
}

std::string DetectionKey(const std::string& content_digest, const Board& board, const DetectOptions& options, int stride) {
  KeptKey key;
  key.Add(kDetectorVersion);
  key.Add("frames by seconds");  // how names are numbered (dataset/footage/frame_numbers.h)
  key.Add(content_digest);
  key.Add(ToString(board));
  key.AddFields(options);
  key.Add("stride " + std::to_string(stride));
  return key.Take();
}

}  // namespace mvstudio::calib
