//! A page with the table and the pictures: one file beside them, no scripts, nothing from elsewhere.

use crate::Evaluation;
use crate::plots::escape;

/// What the page says besides the evaluation.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// Its title.
    pub title: String,
    /// One paragraph below the title; may be empty.
    pub about: String,
    /// How it was made: pairs of a name ("Setup") and a value ("setup.toml"). A value that is a path of a
    /// file in the page's folder is best given in `files`.
    pub made: Vec<(String, String)>,
    /// Files to point to, as paths relative to the page, each with what it is.
    pub files: Vec<(String, String)>,
    /// Folder of `motions.svg` and `deviations.svg`, relative to the page: empty, or such as `evaluation`.
    pub pictures: String,
}

const STYLE: &str = "\
body{font:16px/1.5 system-ui,sans-serif;color:#1a1a1a;background:#fff;max-width:1100px;margin:2.5rem auto;padding:0 1.5rem}
h1{font-size:1.7rem;margin:0 0 .4rem}h2{font-size:1.15rem;margin:2.4rem 0 .7rem}
p{margin:.4rem 0}.about{color:#555;max-width:46rem}
table{border-collapse:collapse;font-variant-numeric:tabular-nums}
.numbers{display:block;overflow-x:auto}
th,td{padding:.3rem .75rem;text-align:right;border-bottom:1px solid #ddd;white-space:nowrap}
th{font-weight:600;border-bottom:2px solid #888}
td:nth-child(-n+2){text-align:left}tr.rotation-begins td{border-top:1px solid #888}
.bad{color:#b30000;font-weight:600}.good{color:#00694e}
dl{display:grid;grid-template-columns:max-content 1fr;gap:.2rem 1.4rem;margin:0}dt{color:#555}dd{margin:0;overflow-wrap:anywhere}
img{width:100%;height:auto;border:1px solid #ddd;border-radius:4px}
code{font:.92em ui-monospace,monospace}footer{margin-top:3rem;color:#777;font-size:.85rem}";

/// The page as text; it shows `motions.svg` and, with a reference, `deviations.svg` of its picture folder.
pub fn html(evaluation: &Evaluation, page: &Page) -> String {
    let folder = page.pictures.trim_end_matches('/');
    let path =
        |name: &str| escape(&if folder.is_empty() { name.to_owned() } else { format!("{folder}/{name}") });
    let mut out = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{STYLE}\n</style>\n</head>\n<body>\n<h1>{title}</h1>\n",
        title = escape(&page.title)
    );
    if !page.about.is_empty() {
        out += &format!("<p class=\"about\">{}</p>\n", escape(&page.about));
    }
    out += &format!("<h2>{}</h2>\n{}", escape(&evaluation.title()), table(evaluation));
    for note in evaluation.notes() {
        out += &format!("<p>{}</p>\n", escape(&note));
    }
    let pictures =
        [("Deviations", "deviations", evaluation.deviation.is_some()), ("Motions", "motions", true)];
    for (heading, name, _) in pictures.iter().filter(|p| p.2) {
        let (svg, png) = (path(&format!("{name}.svg")), path(&format!("{name}.png")));
        out += &format!(
            "<h2>{heading}</h2>\n<a href=\"{svg}\"><img src=\"{svg}\" alt=\"{heading} against time, six panels\"></a>\n\
             <p>As a picture for documents: <a href=\"{png}\">{png}</a></p>\n"
        );
    }
    if !page.made.is_empty() {
        out += "<h2>How it was made</h2>\n<dl>\n";
        for (name, value) in &page.made {
            out += &format!("<dt>{}</dt><dd>{}</dd>\n", escape(name), escape(value));
        }
        out += "</dl>\n";
    }
    if !page.files.is_empty() {
        out += "<h2>Files</h2>\n<dl>\n";
        for (file, what) in &page.files {
            let file = escape(file);
            out += &format!("<dt><a href=\"{file}\"><code>{file}</code></a></dt><dd>{}</dd>\n", escape(what));
        }
        out += "</dl>\n";
    }
    out += &format!("<footer>Gangway {}</footer>\n</body>\n</html>\n", env!("CARGO_PKG_VERSION"));
    out
}

fn table(evaluation: &Evaluation) -> String {
    let cells = evaluation.cells();
    let mut out = "<table class=\"numbers\">\n<tr>".to_owned();
    for cell in &cells.head {
        out += &format!("<th>{}</th>", escape(cell));
    }
    out += "</tr>\n";
    for (i, row) in cells.rows.iter().enumerate() {
        out += if i == 3 { "<tr class=\"rotation-begins\">" } else { "<tr>" };
        for cell in row {
            let class = match cell.as_str() {
                "kept" => " class=\"good\"",
                "NOT kept" => " class=\"bad\"",
                _ => "",
            };
            out += &format!("<td{class}>{}</td>", escape(&cell.replace("+-", "±")));
        }
        out += "</tr>\n";
    }
    out + "</table>\n"
}
