#include <cmath>

#include "avatar/run/pack/run_config.h"
#include "calib/detect/detection_cache.h"
#include "core/disk/files.h"
#include "core/hash/sha256.h"
#include "dataset/detect/models/models.h"
#include "tests/fuzz/fuzz.h"

/// What commands keep for later ones: the configuration of a training run, installed networks, detections.
namespace mvstudio::fuzz {

MVS_FUZZ_TARGET(run_config, bytes) {
  const std::string path = InMemory("config.json", bytes);
  avatar::RunConfig config;
  if (!Accepts([&] { config = avatar::ReadRunConfig(path); })) return;
  Require(std::isfinite(config.half_extent_m) && config.half_extent_m > 0, "a crop without an extent");
  Require(config.pack.size_px > 0 && std::isfinite(config.pack.fill), "a crop without a size");
  for (const double girth : config.shape.girth) Require(std::isfinite(girth), "a girth that is no number");
  const std::string out = MemoryPath("out.json"), again = MemoryPath("again.json");
  avatar::WriteRunConfig(config, out);
  Require(Accepts([&] { avatar::WriteRunConfig(avatar::ReadRunConfig(out), again); }), "what was written cannot be read");
  Require(ReadFile(out) == ReadFile(again), "the configuration changes when it is read and written again");
}

namespace {

std::string Replaced(std::string text, const std::string& what, const std::string& with) {
  for (size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + with.size())) {
    text.replace(at, what.size(), with);
    if (text.size() > (4u << 20)) break;
  }
  return text;
}

std::string Digest(std::string_view bytes) { return Sha256Hex(bytes.data(), bytes.size()); }

}  // namespace

/// The manifest, a net and its weights; in the manifest @net and @weights stand for the hashes of the others, so that what
/// comes after the comparison is reached as well.
MVS_FUZZ_TARGET(model_manifest, bytes) {
  const auto parts = Parts(bytes, 3);
  const std::string root = ScratchFolder("models"), package = "models/human-models-" + detect::PinnedModelPackage().version;
  ScratchFolder(package);
  const std::string manifest = Replaced(std::string(parts[0]), "@net", Digest(parts[1]));
  Scratch(package + "/models.json", Replaced(manifest, "@weights", Digest(parts[2])));
  Scratch(package + "/posenet.json", parts[1]);
  Scratch(package + "/posenet.bin", parts[2]);
  detect::TfjsFiles files;
  if (!Accepts([&] { files = detect::ReadModel("posenet", root); })) return;
  Require(files.json == parts[1], "the net is not what lies in the folder");
  for (const auto& [name, content] : files.shards) {
    Require(name.find('/') == std::string::npos, "weights outside the folder: " + name);
    Require(content == parts[2] || content == parts[1], "weights that are not in the folder");
  }
}

namespace {

std::optional<calib::StoredFootage> Cached(std::string_view bytes) {
  Scratch("detections/key.detections", bytes);
  return calib::DetectionCache(CacheIn(ScratchPath(""))).Load("key");
}

}  // namespace

/// The digest at the end is made here, otherwise nothing behind it is reached.
MVS_FUZZ_TARGET(detection_cache, bytes) {
  static const std::string folder = ScratchFolder("detections");
  std::optional<calib::StoredFootage> footage;
  Require(Accepts([&] { footage = Cached(std::string(bytes) + Digest(bytes)); }), "a damaged cache is an error");
  if (!footage) return;
  for (const auto& image : footage->images) {
    for (const calib::BoardDetection& board : image.layouts) {
      const calib::Detection& found = board.detection;
      Require(found.points_px.cols() == found.num_corners(), "corners without a place");
      Require(found.sigmas_px.size() == 0 || found.sigmas_px.size() == found.num_corners(), "deviations of other corners");
    }
  }
  const std::string out = MemoryPath("cache");
  const auto stored = [&](const calib::StoredFootage& what) {
    calib::DetectionCache(CacheIn(out)).Store("key", what);
    return ReadFile(out + "/detections/key.detections");
  };
  const std::string text = stored(*footage);
  footage = Cached(text);
  Require(footage.has_value(), "what was written cannot be read");
  Require(stored(*footage) == text, "detections change when they are read and written again");
}

}  // namespace mvstudio::fuzz
