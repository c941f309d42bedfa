#include "dataset/pack/build.h"

#include <algorithm>
#include <filesystem>
#include <memory>

#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/manifest.h"
#include "core/disk/output.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/parallel.h"
#include "core/stopwatch.h"
#include "dataset/pack/make_shard.h"
#include "dataset/pack/pack_json.h"
#include "dataset/pack/shard.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using namespace internal;  // NOLINT: the helpers of this module

constexpr uint64_t kMaxSingleBytes = uint64_t{8} << 30;

std::vector<PackUndistortion> StateUndistortion(const PackPlan& plan) {
  std::vector<PackUndistortion> list;
  for (size_t i = 0; plan.view == PackView::kUndistorted && i < plan.views.size(); ++i) {
    const geometry::RigCamera& lens = plan.dataset.rig.cameras[i];
    const UndistortedCamera ideal = IdealPinhole(lens, plan.options.undistort_view);
    const UndistortionError error = MeasureUndistortion(lens, plan.views[i], 1, false);
    list.push_back({lens.camera.name, error.max_joint_px, error.max_map_px, ideal.lost_share, ideal.empty_share});
  }
  return list;
}

// The marker, or nothing when it is missing or damaged: then the shard is made again.
std::optional<DoneMarker> UsableDone(const std::string& path) {
  try {
    return ReadDone(path);
  } catch (const Error&) {
    return std::nullopt;
  }
}

// The folder is new, empty, or holds a pack of this very plan. Several processes may fill it together, so each shard has its
// own lock.
void RequireFolderFor(const PackPlan& plan, const std::string& out) {
  RequireSafeOutput(out, {plan.dataset.root}, true);
  if (!fs::exists(out)) return MakeFolder(out);
  RemoveLeftovers(out);
  if (!fs::is_directory(out)) throw UsageError(out + ": is a file; option 'out' names a folder");
  const auto is_record = [](const auto& entry) { return entry.path().filename().string().rfind(".mvstudio", 0) == 0; };
  const fs::directory_iterator entries(out);
  const bool pack = std::all_of(fs::begin(entries), fs::end(entries), is_record) || !FilesNamed(out, "shard-", "").empty() ||
                    fs::exists(out + "/" + kIndexName) || fs::exists(out + "/" + kManifestName);
  if (!pack) throw UsageError(out + ": is not empty and holds no pack; choose another option 'out'");
  for (const std::string& path : FilesNamed(out, "shard-", ".done.json")) {
    const std::optional<DoneMarker> done = UsableDone(path);
    if (done && done->plan_sha256 != plan.sha256) {
      throw UsageError(
          out + ": holds a pack made with other options or from another dataset; choose another option 'out' or remove it");
    }
  }
}

// Empty when the shard is finished; otherwise why it has to be made.
std::string WhyUnfinished(const PackPlan& plan, const std::string& out, int number, const RunContext& run, DoneMarker* done) {
  const std::string path = ShardPath(out, number);
  const std::optional<DoneMarker> found = UsableDone(DonePath(out, number));
  if (!found) return fs::exists(path) ? "has no done-marker" : "new";
  *done = *found;
  if (found->plan_sha256 != plan.sha256) return "was made with other options";
  std::error_code code;
  if (fs::file_size(path, code) != found->bytes || code) return "is missing or of another size than its done-marker says";
  RequireNoWriter(path);
  if (Sha256File(path) != found->sha256) return "is damaged: its SHA-256 is not that of its done-marker";
  if (InputsSha256(plan, number, run) != found->inputs_sha256) return "was made from images that have changed";
  return "";
}

void RequireSame(const std::string& path, const FileImage& image, const Shard& shard) {
  const std::string written = ReadFile(path);
  if (written != image.view() || !SameContent(ReadShard(path, ShardPart::kAll).shard, shard)) {
    throw IoError(path, "what was read back is not what was written: the disk or the memory is failing");
  }
}

DoneMarker WriteShard(const std::string& path, const Shard& shard, PackTimes* times) {
  const Stopwatch watch;
  const FileImage image = ShardToHdf5(shard, path);
  double verify_s = 0;
  WriteFileAtomic(path, [&](const std::string& temporary) {
    WriteFile(temporary, image.view());
    FlushToDisk(temporary);
    const Stopwatch verifying;
    RequireSame(temporary, image, shard);
    verify_s = verifying.Seconds();
  });
  DoneMarker done;
  done.file = fs::path(path).filename().string();
  done.number = shard.number, done.num_shards = shard.num_shards;
  done.bytes = image.size;
  done.sha256 = Sha256Hex(image.data.get(), image.size);
  done.content_sha256 = ContentSha256(shard);
  done.plan_sha256 = Sha256Hex(shard.plan.data(), shard.plan.size());
  done.samples = static_cast<int64_t>(shard.size());
  times->verify_s += verify_s;
  times->write_s += watch.Seconds() - verify_s;
  return done;
}

/// One call of BuildPack.
class Builder {
 public:
  Builder(PackPlan plan, std::string out, const RunContext& run)
      : plan_(std::move(plan)), out_(std::move(out)), run_(run), tools_(MakeShardTools(plan_)) {
    report_.num_shards = static_cast<int>(plan_.shards.size());
    report_.threads = ResolveThreads(run.num_threads);
    report_.undistortion = StateUndistortion(plan_);
    report_.missing = plan_.missing;
    if (plan_.masks) report_.masks = plan_.dataset.Masks();
    report_.frames_without_person = plan_.frames_without_person;
    report_.frames_beyond = plan_.frames_beyond;
    report_.colour_status = plan_.colour.status;
    report_.colour_reason = plan_.options.match_colours ? plan_.colour.reason : "";
  }

  // False when someone else is at it.
  bool Make(int number) {
    const FileLock lock(out_ + "/.mvstudio." + ShardStem(number) + ".lock");
    if (!lock.owned()) {
      report_.busy_owner = lock.owner();
      return false;
    }
    DoneMarker done;
    const std::string why = WhyUnfinished(plan_, out_, number, run_, &done);
    if (why.empty()) {
      report_.kept.push_back(number);
    } else {
      RequireOurs({ShardPath(out_, number), DonePath(out_, number)});
      if (why != "new") report_.notes.push_back(ShardStem(number) + " " + why + "; made again");
      done = Write(number);
      report_.built.push_back(number);
    }
    report_.samples += done.samples, report_.bytes += done.bytes;
    report_.skipped.insert(report_.skipped.end(), done.skipped.begin(), done.skipped.end());
    return true;
  }

  void Run(const ShardShare& share) {
    int64_t mine = 0;
    for (int number = share.index; number < report_.num_shards; number += share.count) ++mine;
    ProgressStage stage(run_, "pack", mine);
    std::vector<int> busy;
    for (int number = share.index; number < report_.num_shards; number += share.count) {
      if (!Make(number)) busy.push_back(number);
      stage.Advance(1, ShardStem(number));
    }
    // Others may have finished in the meantime.
    for (const int number : busy) {
      if (!Make(number)) report_.busy.push_back(number);
    }
  }

  PackBuildReport& report() { return report_; }

 private:
  DoneMarker Write(int number) {
    MadeShard made = MakeShard(plan_, tools_, number, run_);
    report_.times.decode_s += made.times.decode_s, report_.times.hash_s += made.times.hash_s;
    report_.times.resample_s += made.times.resample_s, report_.times.encode_s += made.times.encode_s;
    DoneMarker done = WriteShard(ShardPath(out_, number), made.shard, &report_.times);
    done.inputs_sha256 = made.inputs_sha256;
    done.skipped = made.skipped;
    WriteFileAtomic(DonePath(out_, number), DoneToJsonText(done));
    return done;
  }

  PackPlan plan_;
  std::string out_;
  const RunContext& run_;
  ShardTools tools_;
  PackBuildReport report_;
};

// Every shard's marker; throws a list of all that is missing or of another pack.
std::vector<DoneMarker> AllDone(const std::string& out) {
  std::vector<DoneMarker> found;
  std::vector<std::string> problems;
  for (const std::string& path : FilesNamed(out, "shard-", ".done.json")) found.push_back(*ReadDone(path));
  if (found.empty()) throw FormatError(out, "", "holds no finished shard; run dataset pack first");
  const int num_shards = found[0].num_shards;
  std::vector<DoneMarker> all(num_shards);
  for (const DoneMarker& done : found) {
    if (done.num_shards != num_shards || done.plan_sha256 != found[0].plan_sha256) {
      throw FormatError(out, done.file,
                        "was made with other options than " + found[0].file + "; a pack has one set of options");
    }
    all[done.number] = done;
  }
  std::string missing;
  int count = 0;
  for (int i = 0; i < num_shards; ++i) {
    if (!all[i].file.empty()) continue;
    if (++count <= 8) missing += (missing.empty() ? "" : ", ") + std::to_string(i);
  }
  if (count > 8) missing += ", …";
  if (count > 0) {
    throw FormatError(out, "",
                      "lacks " + std::to_string(count) + " of " + std::to_string(num_shards) + " shards (" + missing +
                          "); run dataset pack again for them, then option 'merge'");
  }
  return all;
}

void RequireDigests(const std::string& out, const std::vector<DoneMarker>& shards, const RunContext& run) {
  std::vector<char> damaged(shards.size());
  ParallelFor(static_cast<int64_t>(shards.size()), ResolveThreads(run.num_threads), [&](int64_t i) {
    const std::string path = out + "/" + shards[i].file;
    damaged[i] = !fs::exists(path) || Sha256File(path) != shards[i].sha256;
  });
  std::string names;
  for (size_t i = 0; i < shards.size(); ++i) {
    if (damaged[i]) names += (names.empty() ? "" : ", ") + shards[i].file;
  }
  if (!names.empty()) throw FormatError(out, names, "missing or damaged; run dataset pack again, which makes it anew");
}

void WriteIndex(const std::string& out, const std::vector<DoneMarker>& shards) {
  PackIndex index;
  index.plan_sha256 = shards[0].plan_sha256;
  index.plan = ParseJson(ReadShard(ShardPath(out, 0), ShardPart::kTables).shard.plan, ShardPath(out, 0));
  index.shards = shards;
  const FileLock lock(out + "/.mvstudio.INDEX.lock");
  if (!lock.owned()) return;  // someone else found all shards finished as well and writes the same
  const std::string path = out + "/" + kIndexName, text = IndexToJsonText(index);
  if (fs::exists(path) && ReadFile(path) == text) return;
  WriteFileAtomic(path, text);
}

}  // namespace

PackBuildReport BuildPack(const std::string& dataset_root, const std::string& out, const PackOptions& options,
                          const ShardShare& share, const RunContext& run) {
  if (share.count < 1 || share.index < 0 || share.index >= share.count) {
    throw UsageError("option 'shard' " + std::to_string(share.index) + "/" + std::to_string(share.count) +
                     ": use K/N with 0 <= K < N");
  }
  const Stopwatch watch;
  PackPlan plan = MakePackPlan(dataset_root, options, run);
  RequireFolderFor(plan, out);
  Builder builder(std::move(plan), out, run);
  builder.Run(share);
  PackBuildReport& report = builder.report();
  if (share.count == 1 && report.busy.empty()) {
    WriteIndex(out, AllDone(out));
    report.complete = true;
  }
  report.times.wall_s = watch.Seconds();
  return report;
}

PackBuildReport MergePack(const std::string& out, const RunContext& run) {
  const Stopwatch watch;
  RequireFolder(out);
  const std::vector<DoneMarker> shards = AllDone(out);
  RequireDigests(out, shards, run);
  WriteIndex(out, shards);
  PackBuildReport report;
  report.num_shards = static_cast<int>(shards.size());
  for (const DoneMarker& done : shards) {
    report.kept.push_back(done.number);
    report.samples += done.samples, report.bytes += done.bytes;
    report.skipped.insert(report.skipped.end(), done.skipped.begin(), done.skipped.end());
  }
  report.complete = true;
  report.times.wall_s = watch.Seconds();
  return report;
}

void WriteSinglePack(const std::string& pack, const std::string& file) {
  const PackIndex index = ReadIndex(pack + "/" + kIndexName);
  uint64_t bytes = 0;
  for (const DoneMarker& done : index.shards) bytes += std::min(done.bytes, kMaxSingleBytes + 1);
  if (bytes > kMaxSingleBytes) throw ResourceError(pack + ": is larger than 8 GiB; keep it in shards");
  std::vector<Shard> shards;
  for (const DoneMarker& done : index.shards) {
    ReadShardResult read = ReadShard(pack + "/" + done.file, ShardPart::kAll);
    if (read.content_sha256 != done.content_sha256) {
      throw FormatError(pack, done.file, "is not the shard of the index; run dataset pack option 'merge'");
    }
    shards.push_back(std::move(read.shard));
  }
  PackTimes times;
  WriteShard(file, Concatenate(shards), &times);
}

}  // namespace mvstudio::dataset
