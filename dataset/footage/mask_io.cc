#include "dataset/footage/mask_io.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>

#include "core/disk/paths.h"
#include "core/error.h"
#include "core/join.h"
#include "dataset/footage/image_io.h"

namespace mvstudio::dataset {
namespace fs = std::filesystem;
namespace {

constexpr char kImage[] = "is a picture of many shades, not a mask: 255 must be the person and 0 the background";
constexpr size_t kMostFiles = 48;          // looked at to decide
constexpr size_t kMostLabels = 64;         // parts of a body; more numbers are shades
constexpr double kHigh = 0.9, kLow = 0.1;  // of the largest number: what is person or background up to the losses of JPEG

/// One number a pixel, as the file has it.
struct Plane {
  int width = 0, height = 0, most = 255;
  std::vector<uint16_t> values;
  bool colourful = false;  ///< more colours that are no grey than labels have
};

/// Colours of labels are few; those of a photograph are many. Grey ones with the losses of JPEG are none.
bool IsColourful(const RawImage& raw) {
  if (raw.channels < 3) return false;
  const size_t n = static_cast<size_t>(raw.width) * raw.height, k = static_cast<size_t>(raw.channels);
  const int grey = raw.most / 8, step = raw.most / 32 + 1;
  std::set<int> colours;
  for (size_t i = 0; i < n && colours.size() <= kMostLabels; ++i) {
    const uint16_t* const p = raw.values.data() + i * k;
    if (std::max({p[0], p[1], p[2]}) - std::min({p[0], p[1], p[2]}) <= grey) continue;
    colours.insert((p[0] / step * 32 + p[1] / step) * 32 + p[2] / step);
  }
  return colours.size() > kMostLabels;
}

/// The largest of the colours, so that a label's colour counts whatever it is; or the opacity.
Plane PlaneOf(const RawImage& raw, bool alpha) {
  Plane plane{raw.width, raw.height, raw.most, {}, !alpha && IsColourful(raw)};
  const size_t n = static_cast<size_t>(raw.width) * raw.height, k = static_cast<size_t>(raw.channels);
  plane.values.resize(n);
  for (size_t i = 0; i < n; ++i) {
    const uint16_t* const p = raw.values.data() + i * k;
    plane.values[i] = alpha ? p[3] : k >= 3 ? std::max({p[0], p[1], p[2]}) : p[0];
  }
  const auto largest = std::max_element(plane.values.begin(), plane.values.end());
  if (plane.most > 255 && largest != plane.values.end() && *largest <= 255) plane.most = 255;  // 8-bit numbers in 16 bits
  return plane;
}

bool Varies(const std::vector<uint16_t>& values) {
  return std::any_of(values.begin(), values.end(), [&](uint16_t v) { return v != values.front(); });
}

enum class Kind { kNobody, kLabels, kBinary, kSoft, kFaint, kUnclear };

/// What one file looks like by itself.
struct Look {
  Kind kind = Kind::kNobody;
  std::vector<int> labels;  ///< of kLabels
  int brightest = 0, most = 255;
  size_t numbers = 0;  ///< different ones above 0
  double share = 0;    ///< of the pixels that are not 0
  bool inverted = false, everywhere = false;
  std::string why;  ///< of kUnclear
};

/// Foreground along `least` of the border, background in the middle.
bool LooksInverted(const Plane& plane, double share, double least) {
  if (share <= 0.5 || share >= 1) return false;
  const auto at = [&](int x, int y) { return plane.values[static_cast<size_t>(y) * plane.width + x] > 0; };
  int64_t border = 0, on = 0;
  const auto count = [&](int x, int y) { ++border, on += at(x, y); };
  for (int x = 0; x < plane.width; ++x) count(x, 0), count(x, plane.height - 1);
  for (int y = 0; y < plane.height; ++y) count(0, y), count(plane.width - 1, y);
  return on >= least * static_cast<double>(border);
}

Kind KindOf(const std::map<int, size_t>& counts, Look* look) {
  double high = 0, middle = 0, low = 0;
  for (const auto& [value, n] : counts) {
    const double level = value / static_cast<double>(look->most), pixels = static_cast<double>(n);
    (level >= kHigh ? high : level > kLow ? middle : low) += pixels;
  }
  const double all = high + middle + low;
  const bool few = counts.size() <= kMostLabels;
  if (look->brightest < kHigh * look->most) return few ? Kind::kLabels : Kind::kFaint;
  if (middle + low == 0) return Kind::kBinary;
  if (counts.size() <= kMostLabels / 2 && all >= 50.0 * static_cast<double>(counts.size()) && high < 0.5 * all) {
    look->why = "holds labels beside " + std::to_string(look->brightest) +
                ": which of them is the person? write 255 for the person, else 0";
    return Kind::kUnclear;
  }
  if (middle > 0.5 * (middle + high) && middle >= 1000) {
    look->why = kImage;
    return Kind::kUnclear;
  }
  return Kind::kSoft;
}

Look LookAt(const Plane& plane) {
  Look look;
  look.most = plane.most;
  std::vector<size_t> histogram(static_cast<size_t>(plane.most) + 1);
  for (const uint16_t value : plane.values) ++histogram[value];
  std::map<int, size_t> counts;
  for (size_t v = 1; v < histogram.size(); ++v) {
    if (histogram[v] > 0) counts[static_cast<int>(v)] = histogram[v];
  }
  if (counts.empty()) return look;
  look.brightest = counts.rbegin()->first, look.numbers = counts.size();
  look.share = 1 - static_cast<double>(histogram[0]) / static_cast<double>(plane.values.size());
  look.everywhere = histogram[0] == 0;
  look.kind = KindOf(counts, &look);
  const bool shades =
      look.kind == Kind::kSoft && look.numbers > kMostLabels;  // as of a photograph on white, cut at its lower edge
  look.inverted = LooksInverted(plane, look.share, shades ? 0.6 : kHigh);
  if (plane.colourful) look.kind = Kind::kUnclear, look.why = kImage;
  if (look.kind == Kind::kLabels) {
    for (const auto& [value, n] : counts) look.labels.push_back(value);
  }
  return look;
}

std::string NumbersText(const Look& look) {
  if (look.kind == Kind::kLabels && look.labels.size() == 1) return "0 and " + std::to_string(look.brightest);
  if (look.kind == Kind::kBinary) return "0 and " + std::to_string(look.most);
  return "0 to " + std::to_string(look.brightest);
}

/// A few pixels of a person at the edge of a soft mask.
bool IsEdge(const Look& look) { return look.kind == Kind::kFaint || (look.kind == Kind::kLabels && look.share < 0.002); }

/// Numbers that mean something else than in the other files of the set.
void RequireSameKind(const Look& look, const std::string& path, MaskMeaning::Form form) {
  const bool labels = form == MaskMeaning::Form::kLabels;
  if (look.kind == Kind::kUnclear) throw FormatError(path, "values", look.why);
  if (look.kind == Kind::kNobody) return;
  if (form == MaskMeaning::Form::kSoft && IsEdge(look)) return;
  if (look.kind == Kind::kFaint)
    throw FormatError(path, "values",
                      "its brightest pixel is " + std::to_string(look.brightest) + " of " + std::to_string(look.most) +
                          " among " + std::to_string(look.numbers) +
                          " shades: neither a mask of 0 and 255, nor of 0 and 1, nor of labels");
  if (labels == (look.kind == Kind::kLabels)) return;
  throw FormatError(path, "values",
                    "is a mask of " + NumbersText(look) + ", other masks of the set hold " +
                        (labels ? "0 and 1, or labels" : "0 and 255") + ": write them all in one way");
}

/// Whether the opacity of a file is a mask of its own.
bool HasMaskInAlpha(const RawImage& raw) { return raw.channels == 4 && Varies(PlaneOf(raw, true).values); }

/// A mask in the colours that the opacity contradicts, or that has none.
void RequireAlpha(const RawImage& raw, const std::string& path) {
  if (raw.channels != 4)
    throw FormatError(path, "values", "has no opacity, but other masks of the set are in theirs: write them all in one way");
  const Plane alpha = PlaneOf(raw, true), colours = PlaneOf(raw, false);
  const Look look = LookAt(colours);
  if (look.kind != Kind::kBinary || look.everywhere || !Varies(colours.values)) return;
  size_t differ = 0;
  for (size_t i = 0; i < alpha.values.size(); ++i) differ += (alpha.values[i] > alpha.most / 2) != (colours.values[i] > 0);
  if (static_cast<double>(differ) > 0.01 * static_cast<double>(alpha.values.size()))
    throw FormatError(path, "values", "holds one mask in its colours and another in its opacity: leave one of them out");
}

std::vector<std::string> Spread(const std::vector<std::string>& paths) {
  if (paths.size() <= kMostFiles) return paths;
  std::vector<std::string> some;
  for (size_t k = 0; k < kMostFiles; ++k) some.push_back(paths[(2 * k + 1) * paths.size() / (2 * kMostFiles)]);
  return some;
}

/// Empty for a damaged file: whoever needs it is told then.
RawImage ReadIfSound(const std::string& path) {
  try {
    return ReadRawImage(path);
  } catch (const FormatError&) {
    return {};
  } catch (const IoError&) {
    return {};
  }
}

struct Seen {
  std::string path;
  Look look;
};

/// The form that most files have.
MaskMeaning::Form FormOf(const std::vector<Seen>& seen) {
  const auto count = [&](Kind kind) {
    return std::count_if(seen.begin(), seen.end(), [kind](const Seen& s) { return s.look.kind == kind; });
  };
  const auto soft = count(Kind::kSoft), full = soft + count(Kind::kBinary), labels = count(Kind::kLabels);
  if (full + labels + count(Kind::kFaint) + count(Kind::kUnclear) == 0) return MaskMeaning::Form::kNobody;
  if (labels > full) return MaskMeaning::Form::kLabels;
  return soft > 0 ? MaskMeaning::Form::kSoft : MaskMeaning::Form::kBinary;
}

void CheckBackground(const std::vector<Seen>& seen, MaskMeaning* meaning) {
  const size_t people = std::count_if(seen.begin(), seen.end(), [](const Seen& s) { return s.look.kind != Kind::kNobody; });
  size_t everywhere = 0;
  for (const Seen& s : seen) {
    everywhere += s.look.everywhere;
    if (s.look.inverted) meaning->inverted.push_back(s.path);
  }
  if (people == 0) return;
  const Seen& first = *std::find_if(seen.begin(), seen.end(), [](const Seen& s) { return s.look.kind != Kind::kNobody; });
  if (everywhere == people && meaning->form == MaskMeaning::Form::kSoft) throw FormatError(first.path, "values", kImage);
  if (everywhere == people && meaning->form == MaskMeaning::Form::kLabels)
    throw FormatError(first.path, "values", "no pixel is 0, in none of the masks: 0 must be the background");
  if (2 * meaning->inverted.size() > people)
    throw FormatError(
        meaning->inverted.front(), "values",
        "looks inverted, like most masks of the set, or is a picture on white: the border is foreground and the middle is not; "
        "255 must be the person and 0 the background");
  if (everywhere == people) meaning->inverted.push_back(first.path);
}

}  // namespace

MaskMeaning MeaningOfMasks(const std::vector<std::string>& paths) {
  MaskMeaning meaning;
  const std::vector<std::string> some = Spread(paths);
  std::vector<Seen> seen;
  // Colours first; once a file turns up whose opacity is a mask, the set is read again by its opacity.
  for (size_t i = 0; i < some.size(); ++i) {
    const RawImage raw = ReadIfSound(some[i]);
    if (raw.values.empty()) continue;
    if (!meaning.from_alpha && HasMaskInAlpha(raw)) {
      meaning.from_alpha = true, seen.clear(), i = static_cast<size_t>(-1);
      continue;
    }
    if (meaning.from_alpha) RequireAlpha(raw, some[i]);
    seen.push_back({some[i], LookAt(PlaneOf(raw, meaning.from_alpha))});
  }
  meaning.files = static_cast<int>(seen.size());
  if (seen.empty()) return meaning;
  meaning.form = FormOf(seen);
  std::set<int> labels;
  for (const Seen& s : seen) {
    RequireSameKind(s.look, s.path, meaning.form);
    if (meaning.form == MaskMeaning::Form::kLabels) labels.insert(s.look.labels.begin(), s.look.labels.end());
  }
  meaning.labels.assign(labels.begin(), labels.end());
  meaning.lossy_labels = std::any_of(seen.begin(), seen.end(), [&](const Seen& s) {
    return s.look.kind == Kind::kLabels && ReadImageHeader(s.path).codec == "jpeg";
  });
  CheckBackground(seen, &meaning);
  return meaning;
}

std::string MaskMeaning::Text() const {
  std::vector<std::string> parts;
  if (from_alpha) parts.push_back("masks in the opacity of their files");
  if (form == Form::kLabels && labels.size() == 1) {
    const std::string one = std::to_string(labels.front());
    parts.push_back("masks of 0 and " + one + ": " + one + " is the person");
  } else if (form == Form::kLabels) {
    const auto text = [](int label) { return std::to_string(label); };
    const std::vector<int> first(labels.begin(),
                                 labels.begin() + static_cast<std::ptrdiff_t>(std::min<size_t>(labels.size(), 8)));
    parts.push_back("masks of labels (0, " + Join(first, ", ", text) + (labels.size() > 8 ? ", …" : "") +
                    "): everything but 0 is the person");
  } else if (form == Form::kNobody) {
    parts.push_back("masks without anybody: every pixel of the " + std::to_string(files) + " that were looked at is 0");
  }
  if (lossy_labels) parts.push_back("JPEG changes such numbers along outlines: write them as PNG");
  if (!inverted.empty())
    parts.push_back("masks that may be inverted: " + inverted.front() + (inverted.size() > 1 ? " and others" : "") +
                    " is foreground up to the border");
  return Join(parts, "; ");
}

bool MaskMeaning::IsDoubtful() const {
  return !inverted.empty() || lossy_labels || form == Form::kNobody ||
         (form == Form::kLabels && labels.size() == 1 && labels.front() > 64);
}

Image ReadMask(const std::string& path, const MaskMeaning& meaning) {
  const RawImage raw = ReadRawImage(path);
  if (meaning.from_alpha) {
    RequireAlpha(raw, path);
  } else if (HasMaskInAlpha(raw)) {
    throw FormatError(path, "values", "holds a mask in its opacity, other masks of the set do not: write them all in one way");
  }
  const Plane plane = PlaneOf(raw, meaning.from_alpha);
  const Look look = LookAt(plane);
  const auto form = look.kind == Kind::kSoft && meaning.form == MaskMeaning::Form::kBinary ? MaskMeaning::Form::kSoft
                    : meaning.form == MaskMeaning::Form::kNobody                           ? FormOf({{path, look}})
                                                                                           : meaning.form;
  RequireSameKind(look, path, form);
  const bool labels = form == MaskMeaning::Form::kLabels;
  Image mask(plane.width, plane.height, 1);
  const int most = plane.most;
  for (size_t i = 0; i < plane.values.size(); ++i) {
    const int value = plane.values[i];
    mask.pixels[i] = static_cast<uint8_t>(labels ? (value > 0 ? 255 : 0) : (value * 255 + most / 2) / most);
  }
  return mask;
}

Image ReadMask(const std::string& path) { return ReadMask(path, MeaningOfMasks({path})); }

struct MaskFolder::Known {
  std::mutex mutex;
  std::map<std::string, MaskMeaning> of;
};

MaskFolder::MaskFolder() : known_(std::make_shared<Known>()) {}

const MaskMeaning& MaskFolder::Of(const std::string& folder) const {
  const std::lock_guard lock(known_->mutex);
  const auto found = known_->of.find(folder);
  if (found != known_->of.end()) return found->second;
  std::vector<std::string> files;
  const auto is_mask = [](const fs::path& file) { return file.extension() == ".png" && !fs::is_directory(file); };
  const auto add = [&](const std::string& in) {
    for (const std::string& path : FilesIn(in)) {
      if (is_mask(path)) files.push_back(path);
    }
  };
  if (fs::is_directory(folder)) {
    add(folder);
    for (const auto& entry : fs::directory_iterator(folder)) {
      if (entry.is_directory()) add(entry.path().string());
    }
  }
  std::sort(files.begin(), files.end());
  return known_->of.emplace(folder, MeaningOfMasks(files)).first->second;
}

}  // namespace mvstudio::dataset
