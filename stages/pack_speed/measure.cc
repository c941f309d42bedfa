#include "stages/pack_speed/measure.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "core/error.h"
#include "core/format.h"
#include "core/parallel.h"
#include "core/random.h"
#include "dataset/footage/image_io.h"
#include "dataset/pack/build.h"
#include "dataset/pack/pack.h"
#include "dataset/panoptic/panoptic.h"
#include "dataset/views/crop.h"
#include "stages/report_fields.h"

namespace mvstudio::stages {
namespace {

using nlohmann::ordered_json;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kGoodPsnr = 40;

double Now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

/// The samples of a pack with the images that they came from.
struct Source {
  const dataset::PanopticDataset& data;
  std::vector<int> frames;
  std::string jpeg_folder;  // the same images as JPEG of the chosen quality

  std::string JpegPath(const std::string& camera, int frame) const {
    return jpeg_folder + "/" + camera + "_" + std::to_string(frame) + ".jpg";
  }
};

std::vector<int> SpreadFrames(const dataset::PanopticDataset& data, int count) {
  std::vector<int> frames;
  const size_t n = data.frames.size(), wanted = std::min(n, static_cast<size_t>(std::max(count, 1)));
  for (size_t i = 0; i < wanted; ++i) frames.push_back(data.frames[(2 * i + 1) * n / (2 * wanted)]);
  return frames;
}

dataset::PackOptions BuildOptions(const std::string& codec, int crop_px, const std::vector<int>& frames) {
  dataset::PackOptions options;
  FromString(codec, &options.codec);
  options.frames = frames;
  options.full = crop_px == 0;
  if (crop_px) options.crop_px = crop_px;
  return options;
}

/// Reads at random, by several threads, for a while; reads a second.
double ReadRateOnce(size_t count, int threads, double seconds, const std::function<void(size_t)>& read) {
  std::vector<int64_t> done(threads, 0);
  const double start = Now();
  ParallelFor(threads, threads, [&](int64_t t) {
    Rng rng(100 + static_cast<uint64_t>(t));
    while (Now() - start < seconds || done[t] < 3) read(static_cast<size_t>(rng.Index(static_cast<int64_t>(count)))), ++done[t];
  });
  int64_t total = 0;
  for (const int64_t d : done) total += d;
  return static_cast<double>(total) / (Now() - start);
}

/// The best of three, so that other programs on the machine count less.
double ReadRate(size_t count, int threads, double seconds, const std::function<void(size_t)>& read) {
  constexpr int kRuns = 3;
  read(0);
  double best = 0;
  for (int run = 0; run < kRuns; ++run) best = std::max(best, ReadRateOnce(count, threads, seconds / kRuns, read));
  return best;
}

/// Pooled squared difference of many images.
struct Difference {
  double sum = 0, count = 0;
  void Add(const Image& a, const Image& b) {
    if (a.pixels.size() != b.pixels.size()) throw FormatError("pack", "", "images of different size cannot be compared");
    for (size_t i = 0; i < a.pixels.size(); ++i) {
      const double d = static_cast<double>(a.pixels[i]) - b.pixels[i];
      sum += d * d;
    }
    count += static_cast<double>(a.pixels.size());
  }
  double Rms() const { return std::sqrt(sum / std::max(count, 1.0)); }
  double Psnr() const { return sum > 0 ? 20 * std::log10(255 / Rms()) : kInfinity; }
};

/// Every `stride`-th sample: enough for a PSNR.
template <class Read>
Difference Compare(const std::vector<Image>& truth, size_t stride, const Read& read) {
  Difference difference;
  for (size_t i = 0; i < truth.size(); ++i) difference.Add(truth[i], read(i * stride));
  return difference;
}

/// What one crop size is measured with.
struct CropTask {
  int crop_px = 0;
  size_t stride = 1;
  std::vector<Image> truth;  // every stride-th sample, from lossless images
};

Image ReadFromFolder(const Source& source, const dataset::Pack& pack, size_t i, const std::string& path) {
  const dataset::PackSample& sample = pack.samples()[i];
  Image image = dataset::ReadImage(path);
  if (pack.info().view == dataset::PackView::kFull) return image;
  const int at = source.data.rig.Find(pack.rig().cameras[sample.camera_idx].camera.name);
  return dataset::Resample(image, source.data.rig.cameras.at(at), sample.view);
}

std::string CameraOf(const dataset::Pack& pack, size_t i) {
  return pack.rig().cameras[pack.samples()[i].camera_idx].camera.name;
}

class Measurement {
 public:
  Measurement(const dataset::PanopticDataset& data, const PackSpeedOptions& options, const RunContext& run)
      : options_(options), run_(run), source_{data, SpreadFrames(data, options.frames), options.work + "/jpeg"} {}

  void MakeJpegFolder() {
    MakeFolder(source_.jpeg_folder);
    for (const auto& camera : source_.data.rig.cameras) {
      for (const int frame : source_.frames) {
        const std::string& name = camera.camera.name;
        const Image image = dataset::ReadImage(LosslessPath(name, frame));
        dataset::WriteImage(image, source_.JpegPath(name, frame), options_.folder_quality);
        report.width_px = image.width, report.height_px = image.height, ++report.images;
      }
    }
  }

  void MeasureCrop(int crop_px) {
    CropTask task;
    task.crop_px = crop_px;
    const std::string raw = Build("raw", crop_px);
    {
      const dataset::Pack pack = dataset::OpenPack(raw);
      if (pack.samples().empty()) throw FormatError(source_.data.root, "", "no image shows a person");
      task.stride = std::max<size_t>(1, pack.samples().size() / (crop_px ? 48 : 8));
      for (size_t i = 0; i * task.stride < pack.samples().size(); ++i) {
        const size_t at = i * task.stride;
        task.truth.push_back(ReadFromFolder(source_, pack, at, LosslessPath(CameraOf(pack, at), pack.samples()[at].frame)));
      }
      MeasureFolder(task, pack, "jpeg:" + std::to_string(options_.folder_quality), true);
      MeasureFolder(task, pack, "as it is", false);
    }
    for (const std::string& codec : options_.codecs) MeasurePack(task, codec, codec == "raw" ? raw : Build(codec, crop_px));
    RemoveFromWork(raw);
  }

  PackSpeedReport report;

 private:
  std::string LosslessPath(const std::string& camera, int frame) const {
    if (options_.lossless.empty()) return source_.data.ImagePath(camera, frame);
    if (!lossless_) lossless_ = std::make_shared<dataset::PanopticDataset>(dataset::OpenPanopticDataset(options_.lossless));
    return lossless_->ImagePath(camera, frame);
  }

  std::string Build(const std::string& codec, int crop_px) {
    const std::string path = options_.work + "/pack_" + codec + "_" + std::to_string(crop_px);
    const std::string& root = options_.lossless.empty() ? source_.data.root : options_.lossless;
    const dataset::PackBuildReport built =
        dataset::BuildPack(root, path, BuildOptions(codec, crop_px, source_.frames), {}, run_);
    const dataset::PackTimes& t = built.times;
    PackBuildSpeed speed;
    speed.codec = codec, speed.crop_px = crop_px, speed.threads = built.threads;
    speed.build_per_s = static_cast<double>(built.samples) / t.wall_s;
    speed.decode_per_s = DecodeRate(root, built.threads) * static_cast<double>(built.samples) / report.images;
    speed.decode_share = t.decode_s / (t.decode_s + t.hash_s + t.resample_s + t.encode_s + t.write_s + t.verify_s);
    report.builds.push_back(speed);
    return path;
  }

  /// Images a second when nothing is done but reading them and their masks.
  double DecodeRate(const std::string& root, int threads) {
    if (decode_rate_ > 0) return decode_rate_;
    const dataset::PanopticDataset data = dataset::OpenPanopticDataset(root);
    const double start = Now();
    const int64_t cameras = static_cast<int64_t>(data.rig.cameras.size());
    ParallelFor(cameras * static_cast<int64_t>(source_.frames.size()), threads, [&](int64_t i) {
      const std::string& name = data.rig.cameras[i % cameras].camera.name;
      const int frame = source_.frames[i / cameras];
      dataset::ReadImage(data.ImagePath(name, frame));
      if (std::filesystem::exists(data.MaskPath(name, frame))) data.ReadMask(name, frame);
    });
    return decode_rate_ = static_cast<double>(report.images) / (Now() - start);
  }

  void AddTrials(PackSpeedTrial trial, const Difference& difference, size_t count, const std::function<void(size_t)>& read) {
    trial.psnr_db = difference.Psnr(), trial.rms_levels = difference.Rms();
    for (const int threads : options_.threads) {
      trial.threads = std::max(1, threads);
      trial.crops_per_s = ReadRate(count, trial.threads, options_.seconds, read);
      report.trials.push_back(trial);
    }
  }

  void MeasureFolder(const CropTask& task, const dataset::Pack& pack, const std::string& codec, bool jpeg) {
    const auto path = [&](size_t i) {
      const std::string name = CameraOf(pack, i);
      const int frame = pack.samples()[i].frame;
      return jpeg ? source_.JpegPath(name, frame) : source_.data.ImagePath(name, frame);
    };
    PackSpeedTrial trial;
    trial.from_folder = true, trial.codec = codec, trial.crop_px = task.crop_px;
    double bytes = 0;
    for (size_t i = 0; i < pack.samples().size(); ++i) bytes += static_cast<double>(std::filesystem::file_size(path(i)));
    trial.bytes_per_crop = bytes / static_cast<double>(pack.samples().size());
    const auto read = [&](size_t i) { return ReadFromFolder(source_, pack, i, path(i)); };
    AddTrials(trial, Compare(task.truth, task.stride, read), pack.samples().size(), [&](size_t i) { read(i); });
  }

  void MeasurePack(const CropTask& task, const std::string& codec, const std::string& path) {
    {
      const dataset::Pack pack = dataset::OpenPack(path);
      PackSpeedTrial trial;
      trial.codec = codec, trial.crop_px = task.crop_px;
      trial.bytes_per_crop = static_cast<double>(pack.info().bytes) / static_cast<double>(pack.samples().size());
      const auto read = [&](size_t i) { return pack.ReadImage(i); };
      AddTrials(trial, Compare(task.truth, task.stride, read), pack.samples().size(), [&](size_t i) { read(i); });
    }
    if (codec != "raw") RemoveFromWork(path);
  }

  const PackSpeedOptions& options_;
  const RunContext& run_;
  Source source_;
  mutable std::shared_ptr<dataset::PanopticDataset> lossless_;
  double decode_rate_ = 0;
};

std::vector<PackSpeedUp> SpeedUps(const std::vector<PackSpeedTrial>& trials) {
  std::vector<PackSpeedUp> list;
  for (const PackSpeedTrial& folder : trials) {
    if (!folder.from_folder || !(folder.psnr_db >= kGoodPsnr) || folder.crop_px == 0) continue;
    for (const PackSpeedTrial& pack : trials) {
      const bool same = !pack.from_folder && pack.crop_px == folder.crop_px && pack.threads == folder.threads;
      if (!same || !(pack.psnr_db >= kGoodPsnr)) continue;
      list.push_back({folder.crop_px, folder.threads, folder.codec, folder.psnr_db, pack.codec, pack.psnr_db,
                      pack.crops_per_s / folder.crops_per_s});
    }
  }
  return list;
}

std::string CropText(int crop_px) { return crop_px ? std::to_string(crop_px) : std::string("full"); }

std::string PsnrText(double psnr_db) { return std::isfinite(psnr_db) ? Format("%.2f", psnr_db) : "exact"; }

}  // namespace

PackSpeedReport MeasurePackSpeed(const std::string& root, const PackSpeedOptions& options, const RunContext& run) {
  if (options.folder_quality < 1 || options.folder_quality > 100) throw UsageError("the JPEG quality must be 1 to 100");
  const dataset::PanopticDataset data = dataset::OpenPanopticDataset(root);
  Measurement measurement(data, options, run);
  measurement.MakeJpegFolder();
  ProgressStage stage(run, "reading crops", static_cast<int64_t>(options.crops.size()));
  for (const int crop_px : options.crops) {
    measurement.MeasureCrop(crop_px);
    stage.Advance(1, CropText(crop_px));
  }
  measurement.report.speed_ups = SpeedUps(measurement.report.trials);
  return measurement.report;
}

std::string PackSpeedText(const PackSpeedReport& report, const std::vector<bool>& on_front) {
  std::string text = Format("%d images of %dx%d\n", report.images, report.width_px, report.height_px) +
                     "way     codec      crop  threads   crops/s   bytes/crop  PSNR dB\n";
  for (size_t i = 0; i < report.trials.size(); ++i) {
    const PackSpeedTrial& t = report.trials[i];
    text +=
        Format("%-6s  %-8s  %5s  %7d  %8.0f  %11.0f  %7s %s\n", t.Way().c_str(), t.codec.c_str(), CropText(t.crop_px).c_str(),
               t.threads, t.crops_per_s, t.bytes_per_crop, PsnrText(t.psnr_db).c_str(), on_front[i] ? "*" : "");
  }
  text += "*: no other way of this crop size is faster, smaller and nearer to the lossless crop at once\n";
  for (const PackSpeedUp& s : report.speed_ups) {
    text += Format("%4s px, %d thread%s: pack %-7s (%s dB) is %6.1f times as fast as folder %s + crop (%s dB)\n",
                   CropText(s.crop_px).c_str(), s.threads, s.threads == 1 ? "" : "s", s.codec.c_str(),
                   PsnrText(s.pack_psnr_db).c_str(), s.factor, s.folder.c_str(), PsnrText(s.folder_psnr_db).c_str());
  }
  for (const PackBuildSpeed& b : report.builds) {
    text += Format("building %s at %s px: %.1f crops/s; decoding alone would allow %.1f (%.0f %% of the work)\n",
                   b.codec.c_str(), CropText(b.crop_px).c_str(), b.build_per_s, b.decode_per_s, 100 * b.decode_share);
  }
  return text;
}

std::string PackSpeedJson(const PackSpeedReport& report, const std::vector<bool>& on_front) {
  ordered_json json{{"pictures", report.images}, {"width_px", report.width_px}, {"height_px", report.height_px}};
  json["trials"] = RowsJson(report.trials);
  for (size_t i = 0; i < report.trials.size(); ++i) json["trials"][i]["on_front"] = static_cast<bool>(on_front[i]);
  json["speed_ups"] = RowsJson(report.speed_ups), json["builds"] = RowsJson(report.builds);
  return json.dump();
}

}  // namespace mvstudio::stages
