#include "dataset/build/build_blocks.h"

#include <filesystem>

#include "core/disk/files.h"
#include "core/disk/kept.h"
#include "core/disk/manifest.h"
#include "core/disk/trace.h"
#include "core/error.h"
#include "core/format.h"
#include "core/log.h"
#include "dataset/json/json_file.h"

namespace mvstudio::dataset::internal {
namespace fs = std::filesystem;
namespace {

constexpr char kBlockFile[] = "block.json";

KeptResults KeptSamples(const CameraJob& job) { return {CacheIn(job.kept), "samples"}; }

void RemoveKept(const std::vector<std::string>& paths) {
  const UntracedScope untraced;
  try {
    if (!paths.empty()) RemoveOurs(paths);
  } catch (const std::exception& error) {
    Log(LogLevel::kWarning, std::string("parts of an earlier build stay: ") + error.what());
  }
}

}  // namespace

std::optional<FootageSamples> ReadKeptSamples(const CameraJob& job) {
  const std::optional<std::string> bytes = job.kept.empty() ? std::nullopt : KeptSamples(job).Load(job.name);
  if (!bytes) return std::nullopt;
  try {
    KeptReader in(*bytes);
    FootageSamples samples;
    samples.width = in.Get<int>(), samples.height = in.Get<int>();
    samples.gaps = in.All<int>(), samples.time_steps = in.All<int>();
    for (uint64_t left = in.Count(1); left > 0; --left) {
      Image image;
      image.width = in.Get<int>(), image.height = in.Get<int>(), image.channels = in.Get<int>();
      image.pixels = in.All<uint8_t>();
      if (image.pixels.size() != static_cast<size_t>(image.width) * image.height * image.channels) throw DamagedBytes();
      samples.frames.push_back(std::move(image));
    }
    return samples;
  } catch (const DamagedBytes&) {
    KeptSamples(job).Damaged(job.name);
  }
  return std::nullopt;
}

void KeepSamples(const FootageSamples& samples, const CameraJob& job) {
  if (job.kept.empty()) return;
  KeptWriter out;
  out.Put(samples.width), out.Put(samples.height);
  out.PutAll(samples.gaps.data(), samples.gaps.size());
  out.PutAll(samples.time_steps.data(), samples.time_steps.size());
  out.Put<uint64_t>(samples.frames.size());
  for (const Image& image : samples.frames) {
    out.Put(image.width), out.Put(image.height), out.Put(image.channels);
    out.PutAll(image.pixels.data(), image.pixels.size());
  }
  KeptSamples(job).Store(job.name, out.Take());
}

std::string BuiltBlockFolder(const CameraJob& job, int64_t block) {
  return job.kept.empty() ? "" : job.kept + "/" + job.name + Format("-%06lld", static_cast<long long>(block));
}

std::optional<BuiltBlock> ReadBuiltBlock(const std::string& folder) {
  const UntracedScope untraced;
  const std::string path = folder + "/" + kBlockFile;
  if (folder.empty() || !fs::exists(path)) return std::nullopt;
  try {
    if (!FilesInTheWay(folder).empty()) throw FormatError(folder, "", "holds other files than were written");
    const std::optional<Manifest> listed = ReadManifest(folder);
    for (const auto& [name, entry] : listed ? listed->files : std::map<std::string, ManifestEntry>{}) {
      if (!fs::exists(folder + "/" + name)) throw FormatError(folder, name, "is gone");
    }
    const Json json = ParseJson(ReadFile(path), path);
    BuiltBlock block;
    block.built.images = json.at("images"), block.built.mean_area_fraction = json.at("area");
    block.built.joints = json.at("joints"), block.built.joints_on_mask = json.at("on_mask");
    block.built.joints_supported = json.at("supported");
    block.built.without_mask = json.at("without_mask").get<std::vector<int>>();
    block.ended = json.at("ended");
    return block;
  } catch (const std::exception& error) {
    Log(LogLevel::kWarning, std::string("a part of an earlier build is made anew: ") + error.what());
  }
  return std::nullopt;
}

void WriteBuiltBlock(const BuiltBlock& block, const std::string& folder) {
  const Json json = {{"images", block.built.images},
                     {"area", block.built.mean_area_fraction},
                     {"joints", block.built.joints},
                     {"on_mask", block.built.joints_on_mask},
                     {"supported", block.built.joints_supported},
                     {"without_mask", block.built.without_mask},
                     {"ended", block.ended}};
  WriteFileAtomic(folder + "/" + kBlockFile, json.dump() + "\n");
}

void TakeBuiltBlock(const std::string& folder, const std::string& dataset) {
  const UntracedScope untraced;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const std::string relative = entry.path().lexically_relative(folder).string();
    const bool record = entry.path().parent_path() == fs::path(folder);
    if (!entry.is_regular_file() || record) continue;
    const std::string to = dataset + "/" + relative;
    MakeFolder(fs::path(to).parent_path().string());
    if (!HardLink(entry.path().string(), to)) CopyFile(entry.path().string(), to);
  }
}

BlockKeeper::BlockKeeper(const std::string& place, const std::string& key) : place_(place), key_(key) {
  hidden_ = !place.empty() && fs::path(place).filename().string()[0] == '.';
  std::error_code none;
  std::vector<std::string> old;
  if (hidden_) {
    for (const auto& entry : fs::directory_iterator(place, none)) {
      const std::string name = entry.path().filename().string();
      if (name != key_ && name[0] != '.') old.push_back(entry.path().string());
    }
  }
  RemoveKept(old);
}

void BlockKeeper::Forget() {
  if (place_.empty()) return;
  if (fs::exists(place_ + "/" + key_)) RemoveKept({place_ + "/" + key_});
  if (hidden_ && fs::exists(place_)) RemoveKept({place_});
}

void AddBlock(const BuiltCamera& block, BuiltCamera* built) {
  built->images += block.images, built->mean_area_fraction += block.mean_area_fraction;
  built->joints += block.joints, built->joints_on_mask += block.joints_on_mask;
  built->joints_supported += block.joints_supported;
  built->without_mask.insert(built->without_mask.end(), block.without_mask.begin(), block.without_mask.end());
}

}  // namespace mvstudio::dataset::internal
