#include "dataset/exports/images.h"

#include <atomic>
#include <filesystem>
#include <mutex>
#include <optional>
#include <set>

#include "core/check.h"
#include "core/disk/files.h"
#include "core/error.h"
#include "core/parallel.h"
#include "dataset/footage/image_io.h"
#include "dataset/footage/mask_io.h"
#include "dataset/views/undistort.h"

namespace mvstudio::exports {
namespace fs = std::filesystem;
namespace {

/// By EXIF: some readers turn such a file and some do not. It is written turned, without the tag.
bool AsksForTurn(const std::string& image) { return dataset::ReadImageHeader(image).turn.any(); }

/// True when the file is linked: it takes no space.
bool LinkOrCopy(const std::string& from, const std::string& to, bool link) {
  if (link && !fs::is_symlink(from) && HardLink(from, to)) return true;
  CopyFile(from, to);
  return false;
}

void RequireSize(const Image& image, const geometry::Camera& camera, const std::string& path) {
  if (image.width == camera.width_px && image.height == camera.height_px) return;
  throw FormatError(path, "",
                    "is " + std::to_string(image.width) + "x" + std::to_string(image.height) + ", the calibration says " +
                        std::to_string(camera.width_px) + "x" + std::to_string(camera.height_px) +
                        "; run `mvstudio dataset verify`");
}

}  // namespace

struct Images::Task {
  size_t view = 0;
  std::string from, to, also_to;  ///< absolute
  int frame = 0;
  bool mask = false;
  bool alpha = false;     ///< an image with its mask as alpha
  bool has_mask = false;  ///< of an alpha
  MaskValues values = MaskValues::k255;
};

/// One undistorter a view, made when first needed.
struct Images::Resampling {
  explicit Resampling(size_t count) : undistorters(count) {}
  std::vector<std::optional<dataset::Undistorter>> undistorters;
  std::mutex mutex;

  const dataset::Undistorter& Of(size_t index, const View& view) {
    const std::lock_guard lock(mutex);
    if (!undistorters[index]) undistorters[index].emplace(view.source, view.camera);
    return *undistorters[index];
  }
};

Images::Images(const Take& take, const ExportOptions& options, std::string folder)
    : take_(take), options_(options), folder_(std::move(folder)), resampling_(new Resampling(take.views.size())) {
  dataset_.root = take_.root, dataset_.mask_folder = take_.mask_folder;
}
Images::~Images() = default;

std::string Images::SourceOf(size_t view, int frame, bool mask) const {
  if (options_.images == ExportImages::kNone || take_.root.empty()) return "";
  const std::string& name = take_.views.at(view).info.source;
  const std::string path = mask ? dataset_.MaskPath(name, frame) : dataset_.ImagePath(name, frame);
  return fs::is_regular_file(path) ? path : "";
}

void Images::CountImage(size_t view, int frame, bool is_missing) {
  if (options_.images == ExportImages::kNone) return;
  dataset::MissingOfCamera& of = missing_.by_camera[take_.views.at(view).info.source];
  ++of.asked;
  if (!is_missing) return;
  ++missing_images_;
  of.no_image.insert(frame);
}

void Images::CountMissingMask(size_t view, int frame) {
  if (options_.images == ExportImages::kNone) return;
  ++missing_masks_;
  if (!SourceOf(view, frame, false).empty()) missing_.by_camera[take_.views.at(view).info.source].no_mask.insert(frame);
}

void Images::RequireAny() const {
  int without = 0;
  for (const auto& [camera, of] : missing_.by_camera) without += static_cast<int>(of.no_image.size());
  if (without > 0 && without == missing_.asked()) {
    throw FormatError(take_.root, "hdImgs",
                      "holds none of the " + std::to_string(without) + " images of these cameras and frames");
  }
}

std::string Images::AddImage(size_t view, int frame, const std::string& stem, const std::string& extension) {
  const std::string from = SourceOf(view, frame, false);
  CountImage(view, frame, from.empty());
  if (from.empty()) return "";
  Task task;
  task.view = view, task.frame = frame, task.from = from;
  task.alpha = options_.masks == ExportMasks::kAlpha;
  const std::string kept = extension.empty() ? fs::path(from).extension().string() : extension;
  const std::string name = stem + (task.alpha ? ".png" : kept);
  task.to = folder_ + "/" + name;
  if (task.alpha) {
    task.has_mask = !SourceOf(view, frame, true).empty();
    if (!task.has_mask) CountMissingMask(view, frame);
  }
  tasks_.push_back(task);
  return name;
}

bool Images::AddMask(size_t view, int frame, const std::string& path, MaskValues values) {
  if (options_.masks != ExportMasks::kFolder) return false;
  const std::string from = SourceOf(view, frame, true);
  if (from.empty()) {
    CountMissingMask(view, frame);
    return false;
  }
  Task task;
  task.view = view, task.frame = frame, task.from = from, task.to = folder_ + "/" + path;
  task.mask = true, task.values = values;
  tasks_.push_back(task);
  return true;
}

void Images::AlsoTo(const std::string& path) { tasks_.back().also_to = folder_ + "/" + path; }

Image Images::LoadImage(size_t view, int frame) const {
  const std::string from = SourceOf(view, frame, false);
  if (from.empty()) return {};
  const View& v = take_.views[view];
  Image image = dataset::ReadImage(from);
  RequireSize(image, v.source.camera, from);
  return v.info.undistorted ? resampling_->Of(view, v).Apply(image) : image;
}

Image Images::LoadMask(size_t view, int frame) const {
  const std::string from = SourceOf(view, frame, true);
  if (from.empty()) return {};
  const View& v = take_.views[view];
  Image image = dataset::ReadMask(from, dataset_.Masks());
  RequireSize(image, v.source.camera, from);
  return v.info.undistorted ? resampling_->Of(view, v).Mask(image) : image;
}

/// Black outside: newer loaders of Gaussian splatting compare the image as it is with a rendering times alpha, older ones
/// multiply both, gsplat ignores alpha.
Image Images::LoadWithAlpha(size_t view, int frame) const {
  const Image rgb = LoadImage(view, frame), mask = LoadMask(view, frame);
  Image image(rgb.width, rgb.height, 4, 255);
  for (size_t i = 0; i < static_cast<size_t>(rgb.width) * rgb.height; ++i) {
    const uint8_t alpha = mask.empty() ? 255 : mask.pixels[i];
    for (size_t c = 0; c < 3; ++c) image.pixels[4 * i + c] = alpha == 0 ? 0 : rgb.pixels[3 * i + c];
    image.pixels[4 * i + 3] = alpha;
  }
  return image;
}

/// True for a file that other programs read as this one does: grey or 1 bit, 255 for the person. It is checked here.
bool Images::IsPlain(const std::string& mask) const {
  const dataset::ImageHeader header = dataset::ReadImageHeader(mask);
  dataset::ReadMask(mask, dataset_.Masks());
  using Form = dataset::MaskMeaning::Form;
  const Form form = dataset_.Masks().form;
  return header.codec == "png" && !header.turn.any() && header.channels == 1 && header.bits == 8 &&
         (form == Form::kBinary || form == Form::kSoft);
}

std::string Images::EncodedImage(size_t view, int frame) {
  const std::string from = SourceOf(view, frame, false);
  CountImage(view, frame, from.empty());
  if (from.empty()) return "";
  ++contained_images_;
  const Image image = LoadImage(view, frame);  // a damaged file is refused here
  if (!take_.views[view].info.undistorted && !AsksForTurn(from)) return ReadFile(from);
  return dataset::EncodeImage(image, "picture.jpg", options_.jpeg_quality);
}

std::string Images::EncodedMask(size_t view, int frame) {
  if (options_.masks != ExportMasks::kFolder) return "";
  const std::string from = SourceOf(view, frame, true);
  if (from.empty()) {
    CountMissingMask(view, frame);
    return "";
  }
  ++contained_masks_;
  if (!take_.views[view].info.undistorted && IsPlain(from)) return ReadFile(from);
  return dataset::EncodeImage(LoadMask(view, frame), "mask.png");
}

bool Images::Make(const Task& task) const {
  if (task.alpha) {
    dataset::WriteImage(LoadWithAlpha(task.view, task.frame), task.to);
    return false;
  }
  const View& view = take_.views[task.view];
  const bool same_format = fs::path(task.from).extension() == fs::path(task.to).extension();
  const bool as_it_is = !task.mask || (task.values == MaskValues::k255 && IsPlain(task.from));
  if (!view.info.undistorted && same_format && as_it_is && !AsksForTurn(task.from)) {
    if (!task.mask) RequireSize(dataset::ReadImage(task.from), view.source.camera, task.from);  // as IsPlain reads masks
    return LinkOrCopy(task.from, task.to, options_.images == ExportImages::kLink);
  }
  Image image = task.mask ? dataset::ReadMask(task.from, dataset_.Masks()) : dataset::ReadImage(task.from);
  RequireSize(image, view.source.camera, task.from);
  if (view.info.undistorted) {
    const dataset::Undistorter& undistorter = resampling_->Of(task.view, view);
    image = task.mask ? undistorter.Mask(image) : undistorter.Apply(image);
  }
  if (task.values == MaskValues::k1) {
    for (uint8_t& value : image.pixels) value = value >= 128;
  }
  dataset::WriteImage(image, task.to, options_.jpeg_quality);
  return false;
}

void Images::Run(const RunContext& run, ExportReport* report) {
  std::set<std::string> folders;
  for (const Task& task : tasks_) {
    folders.insert(fs::path(task.to).parent_path().string());
    if (!task.also_to.empty()) folders.insert(fs::path(task.also_to).parent_path().string());
  }
  for (const std::string& folder : folders) MakeFolder(folder);
  ProgressStage stage(run, "pictures", static_cast<int64_t>(tasks_.size()));
  std::mutex mutex;
  int linked = 0;
  ParallelFor(static_cast<int64_t>(tasks_.size()), run.num_threads, [&](int64_t i) {
    const Task& task = tasks_[static_cast<size_t>(i)];
    const bool is_link = Make(task);
    if (!task.also_to.empty()) LinkOrCopy(task.to, task.also_to, options_.images == ExportImages::kLink);
    const std::lock_guard lock(mutex);
    linked += is_link;
    stage.Advance();
  });
  for (const Task& task : tasks_) {
    ++(task.mask ? report->masks : report->images);
    report->masks += task.has_mask;
  }
  report->images += contained_images_;
  report->masks += contained_masks_;
  report->linked += linked;
  report->missing_images += missing_images_;
  report->missing_masks += missing_masks_;
  report->missing = missing_;
}

}  // namespace mvstudio::exports
