#include "stages/click/click_page.h"

#include <nlohmann/json.hpp>

#include "core/disk/files.h"
#include "tests/stages/click_setup.h"
#include "tests/support/temp_dir.h"
#include "tests/support/test.h"

/// The page in a browser: a script that turns the wheel and clicks takes the place of the user, and another one that of the
/// server.
namespace mvstudio::stages {
namespace {

std::string Replaced(std::string text, const std::string& from, const std::string& to) {
  const size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return at == std::string::npos ? text : text.replace(at, from.size(), to);
}

class ClickPageInBrowser : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::system("command -v chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "needs chromium";
  }

  /// What `user` writes into document.title's element: JSON. The script that stands for the server keeps what is sent, and
  /// answers the first save as if another page had saved `theirs` meanwhile, where there is such a scene.
  nlohmann::json Run(const ClickScene& scene, const std::string& user, const ClickScene* theirs = nullptr) {
    const std::string server =
        "<script>window.sent = [];\nconst theirs = " + (theirs ? ClicksJsonText(*theirs, {}) : "null") +
        ", first = " + SceneJsonText(scene, {}) +
        ";\nlet revision = theirs ? theirs.revision : first.revision;\n"
        "window.fetch = async function (name, how) {\n"
        "  if (name === 'scene.json') return {ok: true, status: 200, json: async () => first};\n"
        "  const body = how && how.body ? JSON.parse(how.body) : null;\n"
        "  window.sent.push([name, body]);\n"
        "  if (body && body.revision !== revision) return {ok: false, status: 409, json: async () => theirs};\n"
        "  if (body) ++revision;\n"
        "  return {ok: true, status: 200, json: async () => ({revision, clicks: body ? body.clicks : [], fits: first.fits})};\n"
        "};</script>\n<script>" +
        ClickPageScript() + "</script>\n<script>" + user + "</script>";
    std::string html = Replaced(ClickPageHtml(), "<script src=\"click.js\"></script>", server);
    html =
        Replaced(html, "<link rel=\"stylesheet\" href=\"click.css\">", std::string("<style>") + ClickPageStyle() + "</style>");
    for (size_t c = 0; c < scene.cameras.size(); ++c)
      WriteFileAtomic(folder_ / ("image/" + std::to_string(c) + ".jpg"), scene.cameras[c].jpeg);
    WriteFileAtomic(folder_ / "page.html", html);
    const std::string line =
        "cd " + folder_.path() +
        " && timeout 90 chromium --headless --no-sandbox --disable-gpu --window-size=1200,800 --user-data-dir=" +
        folder_.path() + "/profile --virtual-time-budget=8000 --dump-dom file://" + folder_.path() +
        "/page.html >dom.html 2>log.txt";
    EXPECT_EQ(std::system(line.c_str()), 0);
    const std::string dom = ReadFile(folder_ / "dom.html"), begin = "<pre id=\"result\">", end = "</pre>";
    const size_t from = dom.find(begin);
    EXPECT_NE(from, std::string::npos) << dom;
    if (from == std::string::npos) return {};
    const size_t start = from + begin.size();
    return nlohmann::json::parse(dom.substr(start, dom.find(end, start) - start));
  }

  TempDir folder_;
};

/// Helpers of a user, and what he leaves behind.
constexpr char kUser[] = R"js(
const pause = function (ms) { return new Promise(function (done) { setTimeout(done, ms); }); };
const canvas = document.getElementById('image');
const at = function (u, v, zoom) {  // where a pixel is shown before any zoom
  const box = canvas.getBoundingClientRect(), scale = Math.min(box.width / 640, box.height / 480);
  return {clientX: box.left + (box.width - 640 * scale) / 2 + scale * (u + 0.5),
          clientY: box.top + (box.height - 480 * scale) / 2 + scale * (v + 0.5), bubbles: true, pointerId: 1, button: 0};
};
canvas.setPointerCapture = function () {};
const press = function (place, move) {
  canvas.dispatchEvent(new PointerEvent('pointerdown', place));
  if (move) canvas.dispatchEvent(new PointerEvent('pointermove', {...place, clientX: place.clientX + move, clientY: place.clientY}));
  canvas.dispatchEvent(new PointerEvent('pointerup', {...place, clientX: place.clientX + (move || 0)}));
};
const key = function (name, more) { document.dispatchEvent(new KeyboardEvent('keydown', {key: name, ...more})); };
const leave = function (value) {
  const pre = document.createElement('pre');
  pre.id = 'result';
  pre.textContent = JSON.stringify(value);
  document.body.appendChild(pre);
};
const last = function () { return window.sent[window.sent.length - 1][1].clicks; };
)js";

TEST_F(ClickPageInBrowser, ClicksAtAnyZoomAreThePixelsThatWereMeant) {
  const ClickScene scene = testing::WallScene();
  const auto result = Run(scene, std::string(kUser) + R"js(
(async function () {
  await pause(500);
  press(at(100, 50));                     // point 1, unzoomed
  const zoomed = at(321.5, 200.25);       // the wheel keeps the pixel under the pointer
  canvas.dispatchEvent(new WheelEvent('wheel', {...zoomed, deltaY: -1200, cancelable: true}));
  press(zoomed);                          // point 2
  press(at(10, 10), 60);                  // a drag: no click
  key('p');                               // back to point 2
  key('ArrowRight');
  key('ArrowDown', {shiftKey: true});
  await pause(300);
  const moved = last();
  key('Delete');
  await pause(300);
  const shorter = last();
  document.getElementById('finish').click();
  await pause(300);
  leave({moved: moved, shorter: shorter, names: window.sent.map(function (s) { return s[0]; }), ready: document.body.dataset.ready,
         saved: document.getElementById('saved').textContent, points: document.querySelectorAll('#points li').length});
})();
)js");
  ASSERT_EQ(result["moved"].size(), 2u) << result;
  EXPECT_NEAR(result["moved"][0]["x"].get<double>(), 100, 0.51);
  EXPECT_NEAR(result["moved"][0]["y"].get<double>(), 50, 0.51);
  EXPECT_NEAR(result["moved"][1]["x"].get<double>(), 321.6, 0.51);
  EXPECT_NEAR(result["moved"][1]["y"].get<double>(), 201.25, 0.51);
  EXPECT_EQ(result["moved"][1]["point"], 1);
  EXPECT_EQ(result["shorter"].size(), 1u);
  EXPECT_EQ(result["names"].back(), "finish");
  EXPECT_THAT(result["saved"].get<std::string>(), HasSubstr("may be closed"));
  EXPECT_EQ(result["points"], 12);
  EXPECT_EQ(result["ready"], "yes");
}

TEST_F(ClickPageInBrowser, WhatAnotherPageSavedMeanwhileStays) {
  const ClickScene scene = testing::WallScene();
  ClickScene theirs = testing::WallScene();
  theirs.revision = 3;
  for (int p = 0; p < 3; ++p) theirs.clicks[{0, p}] = TruePx(p);
  const auto result = Run(scene, std::string(kUser) + R"js(
(async function () {
  await pause(500);
  press(at(100, 50));  // point 1, which the other page has, too: the later click counts
  await pause(300);
  const merged = last(), first = document.getElementById('saved').textContent;
  key('p');
  key('Delete');
  await pause(300);
  leave({merged: merged, first: first, shorter: last(), revisions: window.sent.map(function (s) { return s[1].revision; }),
         saved: document.getElementById('saved').textContent});
})();
)js",
                          &theirs);
  ASSERT_EQ(result["merged"].size(), 3u) << result;
  for (const auto& click : result["merged"]) {
    const int point = click["point"];
    EXPECT_NEAR(click["x"].get<double>(), point == 0 ? 100 : TruePx(point).x(), 0.51) << point;
  }
  EXPECT_THAT(result["first"].get<std::string>(), HasSubstr("Another page saved meanwhile"));
  EXPECT_EQ(result["shorter"].size(), 2u);
  EXPECT_EQ(result["revisions"], nlohmann::json({0, 3, 4}));
  EXPECT_EQ(result["saved"], "2 clicks are saved.");
}

TEST_F(ClickPageInBrowser, ShowsResidualsAndTheCamerasInTurn) {
  ClickScene scene = testing::WallScene();
  for (int p = 0; p < 8; ++p) scene.clicks[{0, p}] = TruePx(p) + Eigen::Vector2d(p == 2 ? 25 : 0, 0);
  const auto result = Run(scene, std::string(kUser) + R"js(
(async function () {
  await pause(500);
  const rows = Array.from(document.querySelectorAll('#points li')).map(function (li) { return li.className + '|' + li.textContent; });
  const fit = document.getElementById('fit').textContent;
  key('c');
  await pause(100);
  leave({rows: rows, fit: fit, second: document.getElementById('fit').textContent,
         tabs: Array.from(document.querySelectorAll('#cameras button')).map(function (b) { return b.textContent; })});
})();
)js");
  EXPECT_THAT(result["fit"].get<std::string>(), HasSubstr("rms 0.00 px"));
  EXPECT_THAT(result["rows"][2].get<std::string>(), HasSubstr("off"));
  EXPECT_THAT(result["rows"][2].get<std::string>(), HasSubstr("p3: 25.00 px"));
  EXPECT_THAT(result["rows"][9].get<std::string>(), ::testing::Not(HasSubstr("px")));
  EXPECT_THAT(result["second"].get<std::string>(), HasSubstr("lens is not known"));
  EXPECT_EQ(result["tabs"][1], "b \"2\" (0)");
}

}  // namespace
}  // namespace mvstudio::stages
