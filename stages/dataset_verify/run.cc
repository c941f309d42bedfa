#include "stages/dataset_verify/run.h"

#include <mutex>
#include <optional>
#include <set>
#include <utility>

#include "core/disk/kept_key.h"
#include "core/disk/output.h"
#include "core/error.h"
#include "dataset/pack/pack.h"
#include "stages/dataset/dataset_report.h"
#include "stages/input/fingerprint.h"
#include "stages/part.h"

namespace mvstudio::stages {
namespace {

constexpr char kChecksKind[] = "checks";
/// To be raised whenever a check of a camera finds other things than before.
constexpr char kChecksVersion[] = "mvstudio checks 1";

/// Of everything that a camera's check depends on.
std::string KeyOfChecks(const std::string& dataset, const dataset::VerifyOptions& options) {
  const Fingerprint print = FingerprintOf(dataset);
  KeptKey key;
  key.Add(kChecksVersion);
  key.Add(print.sha256.empty() ? print.stamp : print.sha256);
  key.Add(print.error);
  key.AddFields(options);
  return key.Take();
}

PartReport KeepShare(const std::string& dataset, const dataset::VerifyOptions& options, const DatasetVerifyKept& asked,
                     dataset::KeptChecks checks, const std::string& key, const RunContext& run) {
  const StagePart part = ParsePart(asked.part);
  if (part.kind != PartKind::kShare) throw UsageError("option 'part' " + asked.part + ": cameras are checked by share=K/N");
  if (asked.folder.empty()) throw UsageError("option 'part' needs option 'keep', a folder for the list of what is kept");
  PartReport report{{}, asked.part, asked.folder, {}};
  report.notes.inputs = {dataset};
  checks.index = part.index, checks.count = part.count;
  const auto load = checks.load;
  const auto store = checks.store;
  std::mutex mutex;
  std::set<std::string> kept;  // what an earlier try kept, too
  const auto note = [&](const std::string& camera) {
    const std::lock_guard<std::mutex> lock(mutex);
    kept.insert(std::string(kChecksKind) + "/" + key + "/" + camera);
  };
  checks.load = [&](const std::string& camera) {
    std::optional<std::string> bytes = load(camera);
    if (bytes) note(camera);
    return bytes;
  };
  checks.store = [&](const std::string& camera, std::string bytes) {
    store(camera, std::move(bytes));
    note(camera);
  };
  OutputFolder place(asked.folder, {dataset}, {"part.json"});
  dataset::VerifyDataset(dataset, options, run, checks);
  report.kept.assign(kept.begin(), kept.end());
  WritePart(report, asked.folder);
  return report;
}

}  // namespace

CommandResult RunDatasetVerify(const std::string& path, const dataset::VerifyOptions& options, const DatasetVerifyKept& kept,
                               const RunContext& run) {
  const KeptResults results(kept.cache, kChecksKind);
  if (!results.enabled() || dataset::IsPack(path)) {
    if (!kept.part.empty()) throw UsageError("option 'part' keeps checks of a dataset's cameras: give option 'cache'");
    return VerifyDatasetOrPack(path, options, run);
  }
  const std::string key = KeyOfChecks(path, options);
  dataset::KeptChecks checks;
  checks.load = [&](const std::string& camera) { return results.Load(key + "/" + camera); };
  checks.store = [&](const std::string& camera, std::string bytes) { results.Store(key + "/" + camera, std::move(bytes)); };
  if (!kept.part.empty()) return Describe(KeepShare(path, options, kept, checks, key, run));
  if (kept.cache.kind != CachePlace::Kind::kFolder) checks.store = nullptr;
  const CommandResult result = VerifyDatasetOrPack(path, options, run, checks);
  results.Remove(key);
  return result;
}

}  // namespace mvstudio::stages
