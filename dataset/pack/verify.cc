#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "core/disk/files.h"
#include "core/disk/lock.h"
#include "core/disk/paths.h"
#include "core/error.h"
#include "core/hash/sha256.h"
#include "core/parallel.h"
#include "dataset/pack/pack_data.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

using namespace internal;  // NOLINT: the helpers of this module

constexpr double kJointTolerancePx = 1e-6;

/// One call of VerifyPack.
class Verifier {
 public:
  Verifier(const std::string& path, const PackOpenOptions& options, const RunContext& run)
      : path_(path), options_(options), run_(run) {
    data_.info.path = path;
  }

  PackReport Run() {
    if (fs::is_directory(path_)) {
      Folder();
    } else {
      Shard(path_, nullptr);
    }
    Images();
    Joints();
    Summarise(&data_);
    report_.info = data_.info;
    report_.info.complete = complete_ && report_.num_errors() == 0;
    return std::move(report_);
  }

 private:
  void Add(Finding::Severity severity, const std::string& code, const std::string& path, const std::string& text) {
    report_.findings.push_back({severity, code, path, text});
  }
  void Error(const std::string& code, const std::string& path, const std::string& text) {
    Add(Finding::Severity::kError, code, path, text);
  }
  // The message of an error that names the path itself.
  void Error(const std::string& code, const std::string& path, const std::exception& error) {
    std::string text = error.what();
    if (text.rfind(path + ": ", 0) == 0) text = text.substr(path.size() + 2);
    Error(code, path, text);
  }

  void Folder() {
    std::map<std::string, DoneMarker> shards = Markers();
    const std::string index_path = path_ + "/" + kIndexName;
    if (!fs::exists(index_path)) {
      complete_ = false;
      Error("PCK-INDEX", path_, "is not finished: no INDEX.json; run dataset pack option 'merge'");
    } else {
      try {
        Index(ReadIndex(index_path), &shards);
      } catch (const mvstudio::Error& error) {
        Error("PCK-INDEX", index_path, error);
      }
    }
    for (const std::string& file : FilesNamed(path_, "shard-", ".h5")) {
      if (!shards.count(fs::path(file).filename().string())) {
        Add(Finding::Severity::kWarning, "PCK-STRAY", file, "is neither in INDEX.json nor has it a done-marker");
      }
    }
    ProgressStage stage(run_, "verify shards", static_cast<int64_t>(shards.size()));
    for (const auto& [name, done] : shards) {
      Shard(path_ + "/" + name, &done);
      stage.Advance(1, name);
    }
  }

  std::map<std::string, DoneMarker> Markers() {
    std::map<std::string, DoneMarker> shards;
    for (const std::string& path : FilesNamed(path_, "shard-", ".done.json")) {
      try {
        const DoneMarker done = *ReadDone(path);
        if (ShardStem(done.number) + ".done.json" != fs::path(path).filename()) Error("PCK-DONE", path, "is of another shard");
        shards[done.file] = done;
      } catch (const mvstudio::Error& error) {
        Error("PCK-DONE", path, error);
      }
    }
    return shards;
  }

  // The index decides; markers that say otherwise are findings.
  void Index(const PackIndex& index, std::map<std::string, DoneMarker>* shards) {
    std::map<std::string, DoneMarker> listed;
    for (const DoneMarker& done : index.shards) {
      listed[done.file] = done;
      const auto marker = shards->find(done.file);
      if (marker == shards->end()) {
        Add(Finding::Severity::kWarning, "PCK-DONE", path_ + "/" + done.file, "has no done-marker that can be read");
      } else if (marker->second.sha256 != done.sha256) {
        Error("PCK-INDEX", path_ + "/" + done.file, "was made again after INDEX.json; run dataset pack option 'merge'");
        listed[done.file] = marker->second;
      }
    }
    *shards = std::move(listed);
  }

  void Shard(const std::string& file, const DoneMarker* done) {
    RequireNoWriter(file);
    std::error_code code;
    const uint64_t bytes = fs::file_size(file, code);
    if (code) return Error("PCK-SHARD", file, "cannot be read: " + code.message());
    if (done && bytes != done->bytes) {
      Error("PCK-SHARD", file, "has " + std::to_string(bytes) + " bytes, its done-marker says " + std::to_string(done->bytes));
    } else if (done && Sha256File(file) != done->sha256) {
      Error("PCK-SHARD", file, "is damaged: its SHA-256 is not that of its done-marker");
    }
    try {
      // All of it through HDF5, which checks its own checksums, in a process that may be brought down.
      RunInChild(file, LimitsOf(options_, bytes, true), [&] {
        ReadShard(file, ShardPart::kAll);
        return std::string();
      });
      const ReadShardResult read = ReadShard(file, ShardPart::kTables);
      if (done && read.content_sha256 != done->content_sha256)
        Error("PCK-SHARD", file, "is not the shard that was finished here");
      AddShard(file, read, &data_);
    } catch (const mvstudio::Error& error) {
      Error("PCK-SHARD", file, error);
    }
  }

  void Images() {
    // Pack does not own the data here: it lives as long as this object.
    const Pack pack(std::shared_ptr<const Pack::Data>(&data_, [](const Pack::Data*) {}));
    const auto count = static_cast<int64_t>(data_.samples.size());
    std::vector<std::string> image_errors(data_.samples.size()), mask_errors(data_.samples.size());
    const int64_t step = 256;
    ProgressStage stage(run_, "verify images", count);
    for (int64_t first = 0; first < count; first += step) {
      const int64_t some = std::min(step, count - first);
      ParallelFor(some, ResolveThreads(run_.num_threads), [&](int64_t k) {
        image_errors[first + k] = Try([&] { pack.ReadImage(first + k); });
        mask_errors[first + k] = Try([&] { pack.ReadMask(first + k); });
      });
      stage.Advance(some);
    }
    for (int64_t i = 0; i < count; ++i) {
      const std::string& file = data_.files[data_.places[i].file].path();
      ++report_.images;
      report_.masks += data_.samples[i].has_mask;
      if (!image_errors[i].empty()) Error("PCK-IMAGE", file, image_errors[i]);
      if (!mask_errors[i].empty()) Error("PCK-MASK", file, mask_errors[i]);
    }
  }

  template <class Work>
  std::string Try(const Work& work) {
    try {
      work();
      return "";
    } catch (const FormatError& error) {
      return error.where() + std::string(error.what()).substr(error.path().size() + 2 + error.where().size());
    } catch (const std::exception& error) {
      return error.what();
    }
  }

  // The stored projections are those of the stored joints through the stored camera.
  void Joints() {
    for (size_t i = 0; i < data_.samples.size(); ++i) {
      const PackSample& s = data_.samples[i];
      const geometry::Projector projector(s.view.camera);
      for (int j = 0; j < 19; ++j) {
        if (!s.in_view[j]) continue;
        const auto projection = projector.Project(s.view.cam_from_world * Eigen::Vector3d(s.pose.x_in_world.col(j)));
        const double off_px = projection.status == Status::kOk && s.pose.valid[j] ? (projection.px - s.joints_px.col(j)).norm()
                                                                                  : std::numeric_limits<double>::infinity();
        if (off_px <= kJointTolerancePx) continue;
        Error("PCK-TABLE", data_.files[data_.places[i].file].path(),
              "sample " + std::to_string(data_.places[i].row) + ", joint " + std::to_string(j) +
                  ": joints_px is not the projection of joints_in_world");
        break;
      }
    }
  }

  const std::string path_;
  const PackOpenOptions options_;
  const RunContext& run_;
  Pack::Data data_;
  PackReport report_;
  bool complete_ = true;
};

}  // namespace

int PackReport::num_errors() const {
  return static_cast<int>(std::count_if(findings.begin(), findings.end(),
                                        [](const Finding& f) { return f.severity == Finding::Severity::kError; }));
}

PackReport VerifyPack(const std::string& path, const PackOpenOptions& options, const RunContext& run) {
  if (!fs::exists(path)) throw IoError(path, "no such file or folder");
  if (fs::is_directory(path) && !IsPack(path)) throw IoError(path, "is no pack: neither INDEX.json nor shards in it");
  return Verifier(path, options, run).Run();
}

}  // namespace mvstudio::dataset
