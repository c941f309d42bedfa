#include <sys/resource.h>

#include <filesystem>

#include "dataset/footage/image_io.h"
#include "geometry/rig/rig_io.h"
#include "tests/stages/click_setup.h"
#include "tests/support/ask_page.h"
#include "tests/support/folder_state.h"
#include "tests/support/running_cli.h"
#include "tests/support/test.h"

/// calib click as a browser sees it, by bare sockets; and what strangers see of it.
namespace mvstudio::testing {
namespace {

namespace fs = std::filesystem;
using stages::testing::TruePx;

/// Processor time so far.
double CpuSeconds(const Running& run) {
  const std::string stat = Slurp("/proc/" + run.Pid() + "/stat");
  std::istringstream in(stat.substr(stat.rfind(')') + 2));
  std::vector<std::string> words;
  for (std::string word; in >> word;) words.push_back(word);
  return (std::stod(words.at(11)) + std::stod(words.at(12))) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

class CalibClick : public ::testing::Test {
 protected:
  void SetUp() override {
    geometry::Rig rig;
    geometry::RigCamera camera;
    camera.camera = stages::testing::ClickLens();
    rig.cameras.push_back(camera);
    geometry::WriteRig(rig, folder_ / "lenses.json");
    dataset::WriteImage(stages::testing::DotsImage(), folder_ / "a.png");
    std::string places = "name,x,y,z\n";
    const calib::ScenePoints points = stages::testing::Walls();
    for (int p = 0; p < 12; ++p) {
      const Eigen::Vector3d x = points.x_in_world.col(p);
      places += points.names[static_cast<size_t>(p)] + "," + std::to_string(x.x()) + "," + std::to_string(x.y()) + "," +
                std::to_string(x.z()) + "\n";
    }
    Put(folder_ / "places.csv", places);
  }

  std::vector<std::string> Words() const {
    return {"calib",    "click",
            "--camera", "a=" + (folder_ / "a.png"),
            "--points", folder_ / "places.csv",
            "--calib",  folder_ / "lenses.json",
            "--out",    folder_ / "clicks.csv",
            "--json"};
  }
  /// Waits for the address, and takes it apart.
  bool ReadUrl() {
    return WaitUntil([&] {
      const std::string err = Slurp(folder_ / "stderr"), begin = "http://127.0.0.1:";
      const size_t at = err.find(begin), end = at == std::string::npos ? at : err.find("/ ", at);
      if (end == std::string::npos) return false;
      port_ = std::stoi(err.substr(at + begin.size()));
      base_ = err.substr(err.find('/', at + begin.size()), end + 1 - err.find('/', at + begin.size()));
      return true;
    });
  }
  std::string Get(const std::string& path, const std::string& host = "") const {
    return Ask(port_, "GET " + path + " HTTP/1.1\r\nHost: " + (host.empty() ? Host() : host) + "\r\nConnection: close\r\n\r\n");
  }
  std::string Post(const std::string& path, const std::string& body, const std::string& origin = "") const {
    return Ask(port_, "POST " + path + " HTTP/1.1\r\nHost: " + Host() + "\r\n" +
                          (origin.empty() ? "" : "Origin: " + origin + "\r\n") +
                          "Content-Length: " + std::to_string(body.size()) + "\r\nConnection: close\r\n\r\n" + body);
  }
  std::string Host() const { return "127.0.0.1:" + std::to_string(port_); }
  /// The first points, as a page sends them that saw this revision.
  std::string Clicks(int count, int revision) const {
    nlohmann::json clicks = nlohmann::json::array();
    for (int p = 0; p < count; ++p) clicks.push_back({{"camera", 0}, {"point", p}, {"x", TruePx(p).x()}, {"y", TruePx(p).y()}});
    return nlohmann::json{{"revision", revision}, {"clicks", clicks}}.dump();
  }

  TempDir folder_;
  int port_ = 0;
  std::string base_;
};

TEST_F(CalibClick, FromThePageToACalibration) {
  Running run(Words(), folder_);
  ASSERT_TRUE(ReadUrl()) << Slurp(folder_ / "stderr");
  const std::string page = Get(base_);
  EXPECT_THAT(page, HasSubstr("200 OK"));
  EXPECT_THAT(page, HasSubstr("Content-Security-Policy: default-src 'none'"));
  EXPECT_THAT(Get(base_ + "click.js"), HasSubstr("text/javascript"));
  EXPECT_THAT(Get(base_ + "image/0.jpg"), HasSubstr("image/jpeg"));
  EXPECT_THAT(Get(base_ + "scene.json"), HasSubstr("\"has_lens\":true"));
  EXPECT_THAT(Post(base_ + "clicks.json", Clicks(3, 0)), HasSubstr("3 of the 4 clicks"));
  const std::string fits = Post(base_ + "clicks.json", Clicks(8, 1), "http://" + Host());
  EXPECT_THAT(fits, HasSubstr("\"status\":\"Ok\""));
  EXPECT_THAT(Slurp(folder_ / "clicks.csv"), HasSubstr("a,p8,")) << "saved as they come";
  EXPECT_THAT(Post(base_ + "finish", ""), HasSubstr("200 OK"));
  ASSERT_TRUE(run.Await(kBound));
  const CliRun result = run.Result();
  ASSERT_EQ(result.exit, 0) << result.err;
  EXPECT_EQ(result.Json()["metrics"]["num_clicks"], 8);
  EXPECT_LT(result.Json()["metrics"]["cameras"][0]["rms_px"].get<double>(), 0.01);
  EXPECT_EQ(Ask(port_, "GET / HTTP/1.0\r\n\r\n"), "") << "the port is closed";
  const CliRun placed = RunCli({"calibrate", "--start", folder_ / "lenses.json", "--scene-points", folder_ / "clicks.csv",
                                "--scene-points", folder_ / "places.csv", "--out", folder_ / "calib", "--json"});
  ASSERT_EQ(placed.exit, 0) << placed.err;
  const geometry::Rig rig = geometry::ReadRig(folder_ / "calib/calibration.json");
  const geometry::Rigid3 off = rig.cameras.at(0).cam_from_world * Inverse(stages::testing::CamFromWalls());
  EXPECT_LT(off.translation.norm(), 1e-3);
}

TEST_F(CalibClick, StrangersGetNothing) {
  Running run(Words(), folder_);
  ASSERT_TRUE(ReadUrl()) << Slurp(folder_ / "stderr");
  EXPECT_EQ(base_.size(), 34u);  // 128 random bits
  for (const std::string& path :
       {std::string("/"), std::string("/scene.json"), std::string("/00000000000000000000000000000000/"), base_ + "../",
        base_ + "image/1.jpg", base_ + "image/0.jpg/../../../etc/passwd", base_ + "%2e%2e/etc/passwd", base_ + "/etc/passwd"})
    EXPECT_THAT(Get(path), HasSubstr("404 Not Found")) << path;
  EXPECT_THAT(Get(base_, "evil.example"), HasSubstr("404 Not Found")) << "a name that was bound to this address";
  EXPECT_THAT(Post(base_ + "clicks.json", Clicks(8, 0), "http://evil.example"), HasSubstr("403 Forbidden"));
  EXPECT_THAT(Post(base_ + "finish", "", "null"), HasSubstr("403 Forbidden"));
  EXPECT_THAT(Ask(port_, "DELETE " + base_ + " HTTP/1.1\r\nHost: " + Host() + "\r\nConnection: close\r\n\r\n"),
              HasSubstr("405"));
  EXPECT_THAT(Post(base_ + "clicks.json", "{\"clicks\": [{\"camera\": 9}]}"), HasSubstr("400 Bad Request"));
  EXPECT_THAT(Post(base_ + "elsewhere", ""), HasSubstr("404 Not Found"));
  EXPECT_THAT(Ask(port_, "POST " + base_ + "clicks.json HTTP/1.1\r\nHost: " + Host() + "\r\nContent-Length: 99999999\r\n\r\n"),
              HasSubstr("413 Payload Too Large"));
  EXPECT_THAT(Ask(port_, "no HTTP at all\r\n\r\n"), HasSubstr("400 Bad Request"));
  EXPECT_THAT(Ask(port_, "GET " + base_ + " HTTP/1.1\r\nX: " + std::string(20000, 'x') + "\r\n\r\n"), HasSubstr("431"));
  EXPECT_FALSE(fs::exists(folder_ / "clicks.csv"));
  const std::string tcp = Slurp("/proc/net/tcp"), here = "0100007F:", all = "00000000:";
  char port[8];
  std::snprintf(port, sizeof port, "%04X", port_);
  EXPECT_THAT(tcp, HasSubstr(here + port));
  EXPECT_THAT(tcp, ::testing::Not(HasSubstr(all + port + " 00000000:0000 0A"))) << "listens on other interfaces";
  EXPECT_THAT(Slurp("/proc/net/tcp6"),
              ::testing::Not(HasSubstr(std::string(":") + port + " 00000000000000000000000000000000:0000 0A")));
  run.Send(SIGINT);
  ASSERT_TRUE(run.Await(kBound));
  EXPECT_EQ(run.Result().exit, 130);
  EXPECT_THAT(run.Result().err, HasSubstr("no click was made"));
}

TEST_F(CalibClick, APageThatIsBehindReplacesNothing) {
  Running run(Words(), folder_);
  ASSERT_TRUE(ReadUrl()) << Slurp(folder_ / "stderr");
  EXPECT_THAT(Get(base_ + "scene.json"), HasSubstr("\"revision\":0"));
  EXPECT_THAT(Post(base_ + "clicks.json", Clicks(3, 0)), AllOf(HasSubstr("200 OK"), HasSubstr("\"revision\":1")));
  const std::string saved = Slurp(folder_ / "clicks.csv");
  for (const std::string& late : {Clicks(1, 0), Clicks(12, 2), std::string("{\"clicks\": []}")}) {
    const std::string answer = Post(base_ + "clicks.json", late);
    EXPECT_THAT(answer, AllOf(HasSubstr("409 Conflict"), HasSubstr("\"revision\":1"), HasSubstr("\"point\":2")));
    EXPECT_EQ(Slurp(folder_ / "clicks.csv"), saved);
  }
  Put(folder_ / "clicks.csv", saved + "# by hand\n");
  EXPECT_THAT(Post(base_ + "clicks.json", Clicks(2, 1)), HasSubstr("400 Bad Request"));
  EXPECT_THAT(Get(base_ + "scene.json"), AllOf(HasSubstr("\"revision\":1"), HasSubstr("\"num_clicks\":3"))) << "as before";
}

TEST_F(CalibClick, AnswersAsHttpAsks) {
  Running run(Words(), folder_);
  ASSERT_TRUE(ReadUrl()) << Slurp(folder_ / "stderr");
  const std::string end = "\r\nConnection: close\r\n\r\n";
  for (const std::string& method : {std::string("HEAD "), std::string("DELETE ")}) {
    const std::string head = Ask(port_, method + base_ + " HTTP/1.1\r\nHost: " + Host() + end);
    EXPECT_EQ(head.find("\r\n\r\n") + 4 == head.size(), method == "HEAD ") << head;
    EXPECT_THAT(head, HasSubstr(method == "HEAD " ? "200 OK" : "405"));
  }
  const std::string get = "GET " + base_ + " HTTP/1.1\r\n", host = "Host: " + Host();
  EXPECT_THAT(Ask(port_, get + host + "\r\n" + host + end), HasSubstr("400 Bad Request"));
  EXPECT_THAT(Ask(port_, get + host + "\r\nHost: evil.example" + end), HasSubstr("400 Bad Request"));
  EXPECT_THAT(Ask(port_, get + "Host: evil.example\r\n" + host + end), HasSubstr("400 Bad Request"));
}

/// Without the token, from this machine: half requests until there is no descriptor left.
TEST_F(CalibClick, HalfRequestsWithoutEndDoNotShutTheUserOut) {
  Running run(Words(), folder_, [] {
    const rlimit few = {64, 64};
    setrlimit(RLIMIT_NOFILE, &few);
  });
  ASSERT_TRUE(ReadUrl()) << Slurp(folder_ / "stderr");
  std::vector<int> held;
  for (int i = 0; i < 100; ++i) held.push_back(Connected(port_, "GET / HT"));
  const double before_s = CpuSeconds(run);
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THAT(Get(base_), HasSubstr("200 OK"));
  EXPECT_THAT(Post(base_ + "clicks.json", Clicks(3, 0)), HasSubstr("200 OK"));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10)) << "half of the patience with a connection";
  std::this_thread::sleep_for(std::chrono::seconds(1));
  EXPECT_LT(CpuSeconds(run) - before_s, 0.7) << "it waits, and does not ask again and again";
  for (const int fd : held) close(fd);
}

TEST_F(CalibClick, GoesOnWithItsTableAndKeepsThatOfOthers) {
  {
    Running first(Words(), folder_);
    ASSERT_TRUE(ReadUrl()) << Slurp(folder_ / "stderr");
    Post(base_ + "clicks.json", Clicks(5, 0));
    first.Send(SIGINT);
    ASSERT_TRUE(first.Await(kBound));
  }
  fs::remove(folder_ / "stderr");
  Running second(Words(), folder_);
  ASSERT_TRUE(ReadUrl()) << Slurp(folder_ / "stderr");
  EXPECT_THAT(Get(base_ + "scene.json"), HasSubstr("\"num_clicks\":5"));
  Post(base_ + "finish", "");
  ASSERT_TRUE(second.Await(kBound));
  auto words = Words();
  words[3] = "b=" + (folder_ / "a.png");
  const CliRun other = RunCli(words);
  EXPECT_EQ(other.exit, 2);
  EXPECT_THAT(other.err, HasSubstr("has clicks of camera a, which is not given"));
  words = Words();
  words.insert(words.end(), {"--frame", "3"});
  EXPECT_EQ(RunCli(words).exit, 2) << "an image has no frame 3";
}

TEST_F(CalibClick, InABrowser) {
  if (std::system("command -v chromium >/dev/null 2>&1") != 0) GTEST_SKIP() << "needs chromium";
  Running run(Words(), folder_);
  ASSERT_TRUE(ReadUrl()) << Slurp(folder_ / "stderr");
  Post(base_ + "clicks.json", Clicks(8, 0));
  const std::string line =
      "cd " + folder_.path() +
      " && timeout 90 chromium --headless --no-sandbox --disable-gpu --window-size=1200,800 --user-data-dir=" + folder_.path() +
      "/profile --virtual-time-budget=5000 --dump-dom http://" + Host() + base_ + " >dom.html 2>log.txt";
  EXPECT_EQ(std::system(line.c_str()), 0);
  const std::string dom = Slurp(folder_ / "dom.html");
  EXPECT_THAT(dom, HasSubstr("data-ready=\"yes\"")) << "the page's own policy lets its script run";
  EXPECT_THAT(dom, HasSubstr("rms 0.00 px"));
  EXPECT_THAT(dom, HasSubstr("a (8)"));
}

}  // namespace
}  // namespace mvstudio::testing
