#include "report/page/body_file.h"

#include <cstdint>
#include <cstring>

namespace mvstudio::report {
namespace {

constexpr char kBodyMagic[] = "MVBODY01";
constexpr size_t kBodyHeader = 48;

}  // namespace

bool IsBodyFile(std::string_view bytes) {
  if (bytes.size() < kBodyHeader || bytes.substr(0, 8) != kBodyMagic) return false;
  uint32_t counts[4];  // vertices, faces, bones, frames
  std::memcpy(counts, bytes.data() + 8, sizeof counts);
  const double vertices = counts[0], faces = counts[1], bones = counts[2], frames = counts[3];
  const double size = static_cast<double>(kBodyHeader) + 4 * frames + 12 * faces + 20 * bones * frames + 14 * vertices;
  return frames > 0 && bones > 0 && size == static_cast<double>(bytes.size());
}

}  // namespace mvstudio::report
