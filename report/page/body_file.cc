#include "report/page/body_file.h"

#include <cstdint>
#include <cstring>

#include "report/page/image.h"

namespace mvstudio::report {
namespace {

constexpr char kBodyMagic[] = "MVBODY01", kTextureMagic[] = "MVBTEX01";
constexpr size_t kBodyHeader = 48, kTextureHeader = 20;

}  // namespace

bool IsBodyFile(std::string_view bytes) {
  if (bytes.size() < kBodyHeader || bytes.substr(0, 8) != kBodyMagic) return false;
  uint32_t counts[4];  // vertices, faces, bones, frames
  std::memcpy(counts, bytes.data() + 8, sizeof counts);
  const double vertices = counts[0], faces = counts[1], bones = counts[2], frames = counts[3];
  const double size = static_cast<double>(kBodyHeader) + 4 * frames + 12 * faces + 20 * bones * frames + 14 * vertices;
  return frames > 0 && bones > 0 && size == static_cast<double>(bytes.size());
}

bool IsBodyTexture(std::string_view bytes) {
  if (bytes.size() < kTextureHeader || bytes.substr(0, 8) != kTextureMagic) return false;
  uint32_t counts[3];  // corners, faces, bytes of the image
  std::memcpy(counts, bytes.data() + 8, sizeof counts);
  const double before = static_cast<double>(kTextureHeader) + 8.0 * counts[0] + 12.0 * counts[1];
  if (before + counts[2] != static_cast<double>(bytes.size())) return false;
  return !ImageType(bytes.substr(static_cast<size_t>(before))).empty();
}

}  // namespace mvstudio::report
