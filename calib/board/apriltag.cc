#include "calib/board/apriltag.h"

#include <apriltag/apriltag.h>
#include <apriltag/tag16h5.h>
#include <apriltag/tag25h9.h>
#include <apriltag/tag36h10.h>
#include <apriltag/tag36h11.h>
#include <apriltag/tagCircle21h7.h>
#include <apriltag/tagCircle49h12.h>
#include <apriltag/tagCustom48h12.h>
#include <apriltag/tagStandard41h12.h>
#include <apriltag/tagStandard52h13.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>
#include <tuple>
#include <utility>

#include "calib/board/aruco.h"
#include "calib/board/charuco_layout.h"
#include "calib/board/pixel_origin.h"
#include "core/check.h"
#include "core/join.h"
#include "core/text/words.h"

namespace mvstudio::calib {
namespace {

struct Creator {
  const char* name;
  apriltag_family_t* (*create)();
};

constexpr Creator kCreators[] = {{"36h11", tag36h11_create},
                                 {"25h9", tag25h9_create},
                                 {"16h5", tag16h5_create},
                                 {"36h10", tag36h10_create},
                                 {"Circle21h7", tagCircle21h7_create},
                                 {"Circle49h12", tagCircle49h12_create},
                                 {"Custom48h12", tagCustom48h12_create},
                                 {"Standard41h12", tagStandard41h12_create},
                                 {"Standard52h13", tagStandard52h13_create}};

constexpr int kMinImagePx = 16;        // the library's tiles need a few pixels
constexpr uint32_t kManyTags = 10000;  // a table of all words two bits away from so many would take gigabytes

/// Families are made once and never changed or freed: detectors in several threads read their tables.
class Families {
 public:
  /// With black border of `border` cells; nullptr for an unknown name.
  apriltag_family_t* Get(const std::string& name, int border) {
    const std::lock_guard<std::mutex> lock(mutex_);
    apriltag_family_t*& family = families_[{name, border}];
    if (!family) family = Make(name, border);
    return family;
  }

  /// Same, with its decoding table.
  apriltag_family_t* GetReady(const std::string& name, int border) {
    apriltag_family_t* family = Get(name, border);
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!family->impl) {
      apriltag_detector_t* builder = apriltag_detector_create();
      apriltag_detector_add_family_bits(builder, family, family->ncodes > kManyTags ? 1 : 2);
      Release(builder);
    }
    return family;
  }

  /// Frees a detector, but not the tables of its families.
  static void Release(apriltag_detector_t* detector) {
    zarray_clear(detector->tag_families);
    apriltag_detector_destroy(detector);
  }

 private:
  static apriltag_family_t* Make(const std::string& name, int border) {
    for (const Creator& creator : kCreators) {
      if (name != creator.name) continue;
      apriltag_family_t* family = creator.create();
      family->width_at_border += 2 * (border - 1);
      family->total_width += 2 * (border - 1);
      for (uint32_t i = 0; i < family->nbits; ++i) family->bit_x[i] += border - 1, family->bit_y[i] += border - 1;
      return family;
    }
    return nullptr;
  }

  std::mutex mutex_;
  std::map<std::pair<std::string, int>, apriltag_family_t*> families_;
};

Families& AllFamilies() {
  static Families* const families = new Families;
  return *families;
}

Tag ToTag(const apriltag_detection_t& found, int border) {
  Tag tag;
  tag.id = found.id;
  tag.border = border;
  tag.hamming = found.hamming;
  tag.decision_margin = found.decision_margin;
  for (int k = 0; k < 4; ++k) tag.px.col(k) << found.p[k][0] - kCornerOriginShiftPx, found.p[k][1] - kCornerOriginShiftPx;
  return tag;
}

/// Sorted, each tag once: those with a narrow border can often be read as if they had a wide one.
std::vector<Tag> Distinct(std::vector<Tag> tags) {
  const auto better = [](const Tag& a, const Tag& b) {
    return std::make_tuple(a.id, a.hamming, a.border, a.px(0, 0), a.px(1, 0)) <
           std::make_tuple(b.id, b.hamming, b.border, b.px(0, 0), b.px(1, 0));
  };
  std::sort(tags.begin(), tags.end(), better);
  std::vector<Tag> distinct;
  for (const Tag& tag : tags) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Tag& other) {
      const double side = (other.px.col(0) - other.px.col(1)).norm();
      return other.id == tag.id && (other.px.rowwise().mean() - tag.px.rowwise().mean()).norm() < 0.5 * side;
    });
    if (!known) distinct.push_back(tag);
  }
  return distinct;
}

}  // namespace

const std::vector<std::string>& AllTagFamilies() {
  static const std::vector<std::string> names = [] {
    std::vector<std::string> all;
    for (const Creator& creator : kCreators) all.push_back(creator.name);
    return all;
  }();
  return names;
}

std::string TagFamilyNames() { return Join(AllTagFamilies(), ", "); }

std::string CanonicalTagFamily(const std::string& name) {
  const auto plain = [](const std::string& text) {
    std::string word = PlainWord(text);
    for (const std::string prefix : {"apriltag", "tag"}) {
      if (word.rfind(prefix, 0) == 0) word.erase(0, prefix.size());
    }
    return word;
  };
  for (const std::string& known : AllTagFamilies()) {
    if (plain(known) == plain(name)) return known;
  }
  return CanonicalDictionary(name);
}

std::optional<TagFamily> FindTagFamily(const std::string& name) {
  const apriltag_family_t* family = AllFamilies().Get(name, 1);
  if (!family) return FindArucoFamily(name);
  return TagFamily{name, static_cast<int>(family->ncodes), family->width_at_border, family->total_width,
                   family->reversed_border};
}

TagPattern PatternOf(const TagFamily& family, int id, int border) {
  MVS_CHECK(id >= 0 && id < family.num_tags, "tag " << id << " of family " << family.name);
  MVS_CHECK(border == 1 || (border == 2 && !family.white_inside && !family.aruco), "border = " << border);
  if (family.aruco) return ArucoPattern(family, id);
  apriltag_family_t* wide = AllFamilies().Get(family.name, border);
  image_u8_t* drawn = apriltag_to_image(wide, id);
  TagPattern pattern;
  pattern.border_cells = wide->width_at_border;
  pattern.total_cells = wide->total_width;
  for (int v = 0; v < drawn->height; ++v) {
    for (int u = 0; u < drawn->width; ++u) pattern.black.push_back(drawn->buf[v * drawn->stride + u] == 0);
  }
  std::free(drawn->buf);  // image_u8_destroy is not exported by every build of the library
  std::free(drawn);
  return pattern;
}

std::vector<Tag> FindTags(const TagFamily& family, TagBorder border, const Image& grey) {
  MVS_CHECK(grey.channels == 1, grey.channels << " channels");
  if (std::min(grey.width, grey.height) < kMinImagePx) return {};
  if (family.aruco) return Distinct(FindArucoTags(family, grey));
  const std::unique_ptr<apriltag_detector_t, void (*)(apriltag_detector_t*)> detector(apriltag_detector_create(),
                                                                                      &Families::Release);
  detector->quad_decimate = 1;
  detector->refine_edges = false;
  detector->nthreads = 1;
  const apriltag_family_t* wide = nullptr;
  for (const int cells : {1, 2}) {
    const bool wanted =
        cells == 1 ? border != TagBorder::kWide || family.white_inside : border != TagBorder::kNarrow && !family.white_inside;
    if (!wanted) continue;
    apriltag_family_t* ready = AllFamilies().GetReady(family.name, cells);
    apriltag_detector_add_family(detector.get(), ready);
    if (cells == 2) wide = ready;
  }
  image_u8_t image = {grey.width, grey.height, grey.width, const_cast<uint8_t*>(grey.pixels.data())};
  zarray_t* found = apriltag_detector_detect(detector.get(), &image);
  std::vector<Tag> tags;
  for (int i = 0; i < zarray_size(found); ++i) {
    apriltag_detection_t* detection = nullptr;
    zarray_get(found, i, &detection);
    tags.push_back(ToTag(*detection, detection->family == wide ? 2 : 1));
  }
  apriltag_detections_destroy(found);
  return Distinct(std::move(tags));
}

}  // namespace mvstudio::calib
