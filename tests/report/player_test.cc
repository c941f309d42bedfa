#include "report/page/player.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "report/report.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::report {
namespace {

using mvstudio::testing::TempDir;
using ::testing::HasSubstr;
using ::testing::Not;

template <class T>
void Add(const std::vector<T>& values, std::string* out) {
  out->append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

/// One wide Gaussian of this colour and opacity on a triangle, at two time steps.
std::string OneGaussian(uint8_t r, uint8_t g, uint8_t b, uint8_t opacity) {
  std::string bytes = "MVGPLAY1";
  Add<uint32_t>({1, 1, 3, 2, 1}, &bytes);
  Add<float>({-1, -1, -1, 1, 1, 1, 0, 0, 1}, &bytes);
  Add<int32_t>({7, 9}, &bytes);
  Add<uint32_t>({0, 1, 2, 0}, &bytes);
  for (int time_step = 0; time_step < 2; ++time_step)
    Add<uint16_t>({32768, 32768, 32768, 65535, 32768, 32768, 32768, 65535, 32768}, &bytes);
  Add<uint16_t>({16384, 16384, 32768}, &bytes);
  Add<uint8_t>({230, 230, 230, 128, 128, 128, 255, opacity, r, g, b}, &bytes);
  return bytes;
}

TEST(PlayerFile, IsKnownByItsBeginningAndItsLength) {
  const std::string good = OneGaussian(255, 0, 0, 255);
  EXPECT_TRUE(IsPlayerFile(good));
  for (size_t size = 0; size < good.size(); ++size) EXPECT_FALSE(IsPlayerFile(good.substr(0, size)));
  EXPECT_FALSE(IsPlayerFile(good + "x"));
  EXPECT_FALSE(IsPlayerFile("MVGPLAY2" + good.substr(8)));
  std::string huge = good;
  std::memset(&huge[8], 0xff, 20);
  EXPECT_FALSE(IsPlayerFile(huge)) << "counts whose product does not fit";
}

/// A run whose training left a player, as a report.
Report ReportOf(const TempDir& folder, const std::string& player, const ReportOptions& options = {}) {
  WriteFileAtomic(folder / "player.bin", player);
  const nlohmann::json result = {{"schema", "mvstudio.result/1"},
                                 {"command", "avatar train"},
                                 {"status", "ok"},
                                 {"exit", 0},
                                 {"metrics", {{"method", "gaussians"}}},
                                 {"outputs", {{{"path", "player.bin"}, {"role", "gaussians-player"}}}}};
  WriteFileAtomic(folder / "avatar_train.result.json", result.dump());
  return BuildReport(folder.path(), options);
}

TEST(PlayerFile, IsInsideTheReportWithItsScriptAlone) {
  const TempDir folder;
  const Report report = ReportOf(folder, OneGaussian(255, 0, 0, 255));
  EXPECT_THAT(report.html, HasSubstr("<div class=\"player\" data-file=\"data:application/octet-stream;base64,TVZHUExBWT"));
  EXPECT_THAT(report.html, HasSubstr("script-src 'sha256-"));
  EXPECT_THAT(report.html, Not(HasSubstr("://")));
  EXPECT_TRUE(report.warnings.empty());
  const Report damaged = ReportOf(folder, "MVGPLAY1 and no more");
  EXPECT_THAT(damaged.html, Not(HasSubstr("<script")));
  ASSERT_EQ(damaged.warnings.size(), 1u);
  EXPECT_THAT(damaged.warnings[0].text, HasSubstr("no file of Gaussians in motion"));
  ReportOptions none;
  none.max_image_mb = 0;
  EXPECT_THAT(ReportOf(folder, OneGaussian(255, 0, 0, 255), none).html, Not(HasSubstr("<script")));
}

/// The page in a browser, by its software renderer.
TEST(PlayerInBrowser, DrawsAGaussianInItsColour) {
  if (std::system("command -v chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "needs chromium";
  const TempDir folder;
  ReportOptions client;  // whose page has it unfolded
  client.audience = "client";
  std::string html = ReportOf(folder, OneGaussian(204, 102, 51, 255), client).html;
  const size_t policy = html.find("<meta http-equiv=\"Content-Security-Policy\"");
  html.erase(policy, html.find("\n", policy) - policy);  // so that the script below may run
  const std::string look = R"js(<script>
    const canvas = document.querySelector('canvas'), gl = canvas.getContext('webgl2');
    const out = document.createElement('p');
    if (gl) {
      const pixel = new Uint8Array(4);
      gl.readPixels(canvas.width >> 1, canvas.height >> 1, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      out.textContent = 'middle ' + pixel.join(',');
    } else {
      out.textContent = 'without';
    }
    document.body.append(out);
  </script></body>)js";
  html.replace(html.rfind("</body>"), 7, look);
  WriteFileAtomic(folder / "page.html", html);
  const std::string line =
      "cd " + folder.path() +
      " && timeout 120 chromium --headless --no-sandbox --use-angle=swiftshader --enable-unsafe-swiftshader "
      "--user-data-dir=" +
      folder.path() + "/profile --virtual-time-budget=5000 --dump-dom file://" + folder.path() +
      "/page.html >dom.html 2>log.txt";
  ASSERT_EQ(std::system(line.c_str()), 0);
  const std::string dom = ReadFile(folder / "dom.html");
  if (dom.find("<p>without</p>") != std::string::npos) GTEST_SKIP() << "this chromium has no WebGL 2";
  EXPECT_THAT(dom, HasSubstr(">frame 7</output>"));
  const size_t at = dom.find("<p>middle ");
  ASSERT_NE(at, std::string::npos);
  int r = 0, g = 0, b = 0, a = 0;
  ASSERT_EQ(std::sscanf(dom.c_str() + at, "<p>middle %d,%d,%d,%d", &r, &g, &b, &a), 4);
  // 0.99 of the colour at its middle, which lies a little beside that of the image.
  EXPECT_NEAR(r, 202, 12);
  EXPECT_NEAR(g, 101, 8);
  EXPECT_NEAR(b, 50, 5);
}

}  // namespace
}  // namespace mvstudio::report
