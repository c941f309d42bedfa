#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "report/report.h"
#include "report/viewer/bundle.h"
#include "tests/support/temp_dir.h"

namespace mvstudio::report {
namespace {

using mvstudio::testing::TempDir;
using Json = nlohmann::ordered_json;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kHostile[] = "</script><img src=x onerror=\"window.harm=1\">'\u00fc\u202e";

/// Two cameras a metre apart that look along z, and a person of three joints over five frames.
void SaveRun(const TempDir& folder, const std::string& left = "left") {
  Json cameras = Json::array();
  for (int i = 0; i < 2; ++i) {
    cameras.push_back({{"name", i == 0 ? left : "right"},
                       {"model", "pinhole"},
                       {"size_px", {640, 480}},
                       {"intrinsics", {{"fx", 600}, {"fy", 600}, {"cx", 320}, {"cy", 240}}},
                       {"cam_from_world", {{"rotation_xyzw", {0, 0, 0, 1}}, {"translation", {-1.0 * i, 0, 0}}}}});
  }
  const Json calibration = {{"schema", "mvstudio.calibration/1"}, {"unit", "m"}, {"cameras", cameras}};
  WriteFileAtomic(folder / "calibration.json", calibration.dump());
  const Json result = {{"schema", "mvstudio.result/1"},
                       {"command", "calibrate"},
                       {"status", "warn"},
                       {"metrics", {{"cameras", {{{"name", "right"}, {"rms_px", 0.2125}}}}}},
                       {"argv", {"mvstudio", "calibrate", "--board", "charuco:7x5:100mm:75mm"}},
                       {"warnings", {{{"code", "CAL-LOWCOV"}, {"text", "camera right saw the board in few places"}}}}};
  WriteFileAtomic(folder / "calibrate.result.json", result.dump());
  WriteFileAtomic(folder / "board_poses.csv",
                  "frame,board,x_m,y_m,z_m,qx,qy,qz,qw,num_cameras,num_corners,rms_px\n0,0,0.5,0,2,0,0,0,1,2,24,0.2\n");
  std::string points = "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n",
              covariances = "frame,person,joint,xx,xy,xz,yy,yz,zz\n";
  for (int frame = 10; frame < 15; ++frame) {
    for (const std::string joint : {"MidHip", "Neck", "Nose"}) {
      const std::string key = std::to_string(frame) + ",0," + joint;
      if (joint == "Nose" && frame == 12) {
        points += key + ",LowParallax,,,,1,,\n";
        continue;
      }
      points += key + ",Ok,0.5," +
                (joint == "MidHip" ? "0.3"
                 : joint == "Neck" ? "-0.2"
                                   : "-0.4") +
                ",3,2," + (frame == 13 ? "4" : "1") + ",0.004\n";
      covariances += key + ",0.000016,0,0,0.000016,0,0.0001\n";
    }
  }
  WriteFileAtomic(folder / "points.csv", points);
  WriteFileAtomic(folder / "covariance.csv", covariances);
}

TEST(StudioPage, HoldsTheSceneAndItsScriptAlone) {
  const TempDir folder;
  SaveRun(folder);
  const Report report = BuildReport(folder.path());
  EXPECT_TRUE(report.warnings.empty());
  EXPECT_THAT(report.html, HasSubstr("script-src " + ScriptSource(ViewerScript())));
  EXPECT_THAT(report.html, HasSubstr("<section id=\"studio\">"));
  EXPECT_THAT(report.html, HasSubstr("The view in 3D needs WebGL"));
  EXPECT_THAT(report.html, HasSubstr("<a href=\"#frame=13\">frame 13</a> (4"));
  EXPECT_THAT(report.html, HasSubstr("calibrate: camera right saw the board in few places"));
  EXPECT_LT(ViewerScript().size(), 700'000u);
  EXPECT_THAT(std::string(ViewerScript()), HasSubstr("MIT licence"));
  ReportOptions client;
  client.audience = "client";
  const std::string for_client = BuildReport(folder.path(), client).html;
  EXPECT_THAT(for_client, HasSubstr("<section id=\"studio\">"));
  EXPECT_THAT(for_client, Not(HasSubstr("few places")));
}

template <class T>
void AddNumbers(const std::vector<T>& values, std::string* out) {
  out->append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
}

/// A result whose body is one triangle of a metre in front of both cameras at frames 10 and 11, with `gaussians` (0 or 1) on
/// it.
void SaveBody(const TempDir& folder, const std::string& role, uint32_t gaussians) {
  std::string bytes = "MVGPLAY1";
  AddNumbers<uint32_t>({gaussians, 1, 3, 2, 0}, &bytes);
  AddNumbers<float>({0, -1, 3, 1, 1, 3, 0, -1, 0}, &bytes);
  AddNumbers<int32_t>({10, 11}, &bytes);
  AddNumbers<uint32_t>({0, 1, 2}, &bytes);
  if (gaussians > 0) AddNumbers<uint32_t>({0}, &bytes);
  for (int step = 0; step < 2; ++step) AddNumbers<uint16_t>({0, 0, 0, 0, 65535, 0, 65535, 65535, 0}, &bytes);
  if (gaussians > 0) AddNumbers<uint16_t>({16384, 16384, 32768}, &bytes);
  if (gaussians > 0) AddNumbers<uint8_t>({230, 230, 230, 128, 128, 128, 255, 255, 255, 0, 0}, &bytes);
  WriteFileAtomic(folder / "motion.bin", bytes);
  const Json result = {{"schema", "mvstudio.result/1"},
                       {"command", "avatar train"},
                       {"status", "ok"},
                       {"outputs", {{{"path", "motion.bin"}, {"role", role}}}}};
  WriteFileAtomic(folder / "avatar_train.result.json", result.dump());
}

TEST(StudioPage, AFittedBodyIsThereOnce) {
  const TempDir folder;
  SaveRun(folder);
  EXPECT_THAT(BuildReport(folder.path()).html, Not(HasSubstr("<i data-body=\"")));
  SaveBody(folder, "body-motion", 0);
  EXPECT_THAT(BuildReport(folder.path()).html, HasSubstr("<i data-body=\"TVZHUExBWTEAAAAA"));
  SaveBody(folder, "gaussians-player", 1);
  EXPECT_THAT(BuildReport(folder.path()).html, Not(HasSubstr("<i data-body=\""))) << "the player holds it";
  SaveBody(folder, "body-motion", 0);
  WriteFileAtomic(folder / "motion.bin", "MVGPLAY1 cut");
  const Report cut = BuildReport(folder.path());
  EXPECT_THAT(cut.html, Not(HasSubstr("<i data-body=\"")));
  ASSERT_EQ(cut.warnings.size(), 1u);
  EXPECT_EQ(cut.warnings[0].code, "REP-PICTURE");
}

TEST(StudioPage, ShowsWhatIsThere) {
  const TempDir cameras, people;
  SaveRun(cameras), SaveRun(people);
  std::filesystem::remove(cameras / "points.csv");
  std::filesystem::remove(people / "calibration.json");
  EXPECT_THAT(BuildReport(cameras.path()).html, Not(HasSubstr("data-chunk=\"")));
  EXPECT_THAT(BuildReport(people.path()).html, HasSubstr("data-chunk=\""));
  std::filesystem::remove(people / "points.csv");
  EXPECT_THAT(BuildReport(people.path()).html, Not(HasSubstr("id=\"studio\"")));
}

TEST(StudioPage, TooManyJointsOfOneTimeStepAreNotDrawn) {
  const TempDir folder;
  std::string points = "frame,person,joint,status,x_m,y_m,z_m,num_views,rms_px,sigma_m\n";
  for (int i = 0; i < 2000; ++i) points += "0," + std::to_string(i) + ",j" + std::to_string(i) + ",Ok,1,2,3,2,1,0.004\n";
  WriteFileAtomic(folder / "points.csv", points);
  EXPECT_THAT(BuildReport(folder.path()).html, Not(HasSubstr("data-chunk=\"")));
}

/// The page in a browser, with a script of the test before its own, which the policy allows by its digest as well.
class StudioInBrowser : public ::testing::Test {
 protected:
  /// What `script` gave to `tell`, one line each; the page's errors are lines, too.
  std::string Run(const std::string& hash, const std::string& script, const std::string& flags = "") {
    const std::string probe = R"js(
      window.told = [];
      window.tell = (text) => { told.push(text); };
      window.addEventListener('error', (event) => tell('error ' + event.message));
      document.addEventListener('securitypolicyviolation', (event) => tell('policy ' + event.violatedDirective));
      for (const kind of ['error', 'warn']) { const log = console[kind]; console[kind] = (...all) => { tell(kind + ' ' + all.join(' ')); log(...all); }; }
      window.pause = () => new Promise((go) => setTimeout(go, 200));
      window.addEventListener('load', async () => {
        const root = document.querySelector('.studio');
        try { await (async () => {)js" +
                              script + R"js(})(); } catch (error) { tell('error ' + error); }
        const out = document.createElement('pre');
        out.id = 'told';
        out.textContent = told.join('\n');
        document.body.append(out);
      });
    )js";
    std::string html = BuildReport(folder_.path()).html;
    const std::string policy = "script-src ";
    html.insert(html.find(policy) + policy.size(), ScriptSource(probe) + " ");
    html.insert(html.find("<title>"), "<script>" + probe + "</script>");
    WriteFileAtomic(folder_ / "page.html", html);
    const std::string line = "cd " + folder_.path() +
                             " && timeout 140 chromium --headless --no-sandbox --use-angle=swiftshader "
                             "--enable-unsafe-swiftshader --window-size=1280,900 --user-data-dir=" +
                             folder_.path() + "/profile --virtual-time-budget=100000 " + flags + " --dump-dom 'file://" +
                             folder_.path() + "/page.html" + hash + "' >dom.html 2>log.txt";
    EXPECT_EQ(std::system(line.c_str()), 0);
    const std::string dom = ReadFile(folder_ / "dom.html");
    const size_t begin = dom.find("<pre id=\"told\">");
    return begin == std::string::npos ? "no answer" : dom.substr(begin + 15, dom.find("</pre>", begin) - begin - 15);
  }

  void SetUp() override {
    if (std::system("command -v chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "needs chromium";
  }

  TempDir folder_;
};

TEST_F(StudioInBrowser, DrawsMovesPicksAndKeepsItsStateInTheAddress) {
  SaveRun(folder_);
  const std::string told = Run("#frame=13&camera=right", R"js(
    if (root.dataset.state !== 'ready') { tell('without'); return; }
    const canvas = root.querySelector('.stage canvas'), frame = () => root.querySelector('output').textContent, panel = () => root.querySelector('aside').textContent;
    await pause();
    root.dispatchEvent(new Event('paint'));
    const gl = canvas.getContext('webgl2') || canvas.getContext('webgl'), bytes = new Uint8Array(4 * canvas.width * canvas.height), found = new Set();
    gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
    for (let i = 0; i < bytes.length; i += 4) found.add(bytes[i] + ',' + bytes[i + 1] + ',' + bytes[i + 2]);
    const colours = found.size;
    tell('colours ' + (colours > 8));
    tell('opened at ' + frame() + ' panel ' + panel().includes('0.212') + panel().includes('56\u00b0') + panel().includes('few places'));
    location.hash = '#frame=11&joint=0.Neck';
    await pause();
    tell('link ' + frame() + ' ' + panel());
    const key = (name) => canvas.dispatchEvent(new KeyboardEvent('keydown', { key: name, bubbles: true }));
    key('ArrowRight'); key('ArrowRight'); key('ArrowRight'); key('ArrowLeft');
    tell('keys ' + frame() + ' ' + location.hash.includes('frame=13'));
    key('Escape');
    tell('nothing ' + root.querySelector('aside').hidden);
    key('Home');
    root.dispatchEvent(new Event('paint'));
    const label = Array.from(root.querySelectorAll('.names span')).find((span) => span.textContent === 'left').getBoundingClientRect(), spot = canvas.getBoundingClientRect();
    const offset = { x: parseFloat(getComputedStyle(root.querySelector('.names span')).left), y: parseFloat(getComputedStyle(root.querySelector('.names span')).top) };
    const at = { clientX: label.left - offset.x, clientY: label.top - offset.y, bubbles: true };
    canvas.dispatchEvent(new PointerEvent('pointerdown', at)); canvas.dispatchEvent(new PointerEvent('pointerup', at));
    tell('picked ' + root.querySelector('aside h3').textContent + ' ' + location.hash.includes('camera=left'));
    key(' ');
    await pause();
    tell('plays ' + root.querySelector('.bar button').textContent);
    key(' ');
    tell('wide ' + (document.documentElement.scrollWidth <= innerWidth));
  )js");
  if (told.find("without") != std::string::npos) GTEST_SKIP() << "this chromium has no WebGL";
  EXPECT_THAT(told, HasSubstr("colours true"));
  EXPECT_THAT(told, HasSubstr("opened at frame 13 panel truetruetrue"));
  EXPECT_THAT(told, HasSubstr("link frame 11 Neck"));
  EXPECT_THAT(told, HasSubstr("4.1, 4.1, 9.74"));
  EXPECT_THAT(told, HasSubstr("keys frame 13 true"));
  EXPECT_THAT(told, HasSubstr("nothing true"));
  EXPECT_THAT(told, HasSubstr("picked left true"));
  EXPECT_THAT(told, HasSubstr("plays Pause"));
  EXPECT_THAT(told, HasSubstr("wide true"));
  EXPECT_THAT(told, Not(HasSubstr("error ")));
  EXPECT_THAT(told, Not(HasSubstr("policy ")));
}

/// Counts of pixels that differ between a switch on and off, at a frame of the body and at one three frames behind its last.
constexpr char kSwitchProbe[] = R"js(
    if (root.dataset.state !== 'ready') { tell('without'); return; }
    const canvas = root.querySelector('.stage canvas'), gl = canvas.getContext('webgl2') || canvas.getContext('webgl');
    const box = (name) => Array.from(root.querySelectorAll('label')).find((label) => label.textContent.trim() === name).querySelector('input');
    const pixels = () => {
      root.dispatchEvent(new Event('paint'));
      const bytes = new Uint8Array(4 * canvas.width * canvas.height);
      gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
      return bytes;
    };
    const change = (name) => {
      const before = pixels();
      box(name).click();
      const after = pixels();
      box(name).click();
      let count = 0;
      for (let i = 0; i < before.length; i += 4) if (before[i] !== after[i] || before[i + 1] !== after[i + 1] || before[i + 2] !== after[i + 2]) ++count;
      return count;
    };
    await pause();
    for (const name of names) tell(name + ' drawn ' + (change(name) > (name === 'Gaussians' ? 0 : 20)));
    location.hash = '#frame=14';
    await pause();
    for (const name of names) tell(name + ' elsewhere ' + change(name));
)js";

TEST_F(StudioInBrowser, AFittedBodyIsDrawnAtItsFramesAlone) {
  SaveRun(folder_);
  SaveBody(folder_, "body-motion", 0);
  const std::string told = Run("#frame=10", std::string("const names = ['fitted body'];") + kSwitchProbe);
  if (told.find("without") != std::string::npos) GTEST_SKIP() << "this chromium has no WebGL";
  EXPECT_THAT(told, HasSubstr("fitted body drawn true"));
  EXPECT_THAT(told, HasSubstr("fitted body elsewhere 0"));
  EXPECT_THAT(told, Not(HasSubstr("error ")));
}

TEST_F(StudioInBrowser, GaussiansAreDrawnAsPoints) {
  SaveRun(folder_);
  SaveBody(folder_, "gaussians-player", 1);
  const std::string told = Run("#frame=11", std::string("const names = ['fitted body', 'Gaussians'];") + kSwitchProbe);
  if (told.find("without") != std::string::npos) GTEST_SKIP() << "this chromium has no WebGL";
  EXPECT_THAT(told, HasSubstr("fitted body drawn true"));
  EXPECT_THAT(told, HasSubstr("Gaussians drawn true"));
  EXPECT_THAT(told, HasSubstr("Gaussians elsewhere 0"));
  EXPECT_THAT(told, Not(HasSubstr("error ")));
}

TEST_F(StudioInBrowser, SaysInOneLineThatThereIsNoWebGl) {
  SaveRun(folder_);
  const std::string told = Run("",
                               "tell(root.dataset.state + ' ' + root.textContent.trim() + ' svg ' + "
                               "(document.querySelectorAll('#calibration svg').length > 1));",
                               "--disable-gpu --disable-3d-apis");
  EXPECT_THAT(told, HasSubstr("undefined The view in 3D needs WebGL"));
  EXPECT_THAT(told, HasSubstr("svg true"));
  EXPECT_THAT(told, Not(HasSubstr("error ")));
}

TEST_F(StudioInBrowser, HostileNamesDoNothing) {
  SaveRun(folder_, kHostile);
  const std::string told = Run("", R"js(
    await pause();
    tell('harm ' + window.harm + ' images ' + document.querySelectorAll('img').length);
    if (root.dataset.state !== 'ready') { tell('without'); return; }
    root.dispatchEvent(new KeyboardEvent('keydown', { key: ']', bubbles: true }));
    await pause();
    tell('name ' + (root.querySelector('aside h3').textContent === root.querySelector('.names span').textContent) + root.querySelector('aside h3').textContent.startsWith('</scr' + 'ipt>'));
    tell('harm ' + window.harm + ' images ' + document.querySelectorAll('img').length);
  )js");
  EXPECT_THAT(told, Not(HasSubstr("harm 1")));
  EXPECT_THAT(told, HasSubstr("harm undefined images 0"));
  if (told.find("without") == std::string::npos) {
    EXPECT_THAT(told, HasSubstr("name truetrue"));
  }
  EXPECT_THAT(told, Not(HasSubstr("error ")));
}

}  // namespace
}  // namespace mvstudio::report
