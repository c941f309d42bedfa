#include "report/page/player.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

#include "report/page/html.h"
#include "report/page/image.h"

namespace mvstudio::report {
namespace {

constexpr char kMagic[] = "MVGPLAY1";
constexpr size_t kHeader = 64;

/// Numbers of Gaussians, faces, vertices, time steps; whether the Mip filter is on.
struct Counts {
  uint32_t gaussians = 0, faces = 0, vertices = 0, time_steps = 0, mip = 0;
};

double SizeOf(const Counts& c) {
  return static_cast<double>(kHeader) + 4.0 * c.time_steps + 12.0 * c.faces + 4.0 * c.gaussians +
         6.0 * c.vertices * static_cast<double>(c.time_steps) + 6.0 * c.gaussians + 11.0 * c.gaussians;
}

}  // namespace

bool IsPlayerFile(std::string_view bytes) {
  if (bytes.size() < kHeader || bytes.substr(0, 8) != kMagic) return false;
  Counts counts;
  std::memcpy(&counts, bytes.data() + 8, sizeof counts);
  return counts.time_steps > 0 && SizeOf(counts) == static_cast<double>(bytes.size());
}

std::string PlayerHtml(std::string_view bytes, const std::string& label) {
  return "<div class=\"player\" data-file=\"data:application/octet-stream;base64," + Base64(bytes) +
         "\"><canvas role=\"img\" aria-label=\"" + EscapeHtml(label) +
         "\"></canvas><div><button type=\"button\">Play</button> <input type=\"range\" min=\"0\" value=\"0\" "
         "aria-label=\"time step\"> <output></output></div></div>";
}

}  // namespace mvstudio::report
