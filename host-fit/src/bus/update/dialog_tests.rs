use super::*;
use hal_adapters::can::update::UpdateRequest;

/// Asks for one page, sends two words, and is over.
#[derive(Debug, Default)]
struct Three {
    wishes: u32,
    answers: Vec<Option<(Option<Outcome>, u32)>>,
}

const TELL: Request = Request::Update(UpdateRequest::Tell { page: 3 });

const fn word(index: u8) -> UpdateData {
    UpdateData {
        token: 1,
        index,
        word: 7,
    }
}

impl Job for Three {
    fn next(&mut self) -> Wish {
        self.wishes += 1;
        match self.wishes {
            1 => Wish::Ask {
                request: TELL,
                transfer: None,
            },
            2 | 3 => Wish::Send(word(self.wishes as u8)),
            _ => Wish::Over,
        }
    }

    fn answered(&mut self, request: Request, outcome: Option<Outcome>, detail: u32) {
        assert_eq!(request, TELL);
        self.answers.push(Some((outcome, detail)));
    }

    fn unanswered(&mut self) {
        self.answers.push(None);
    }

    fn interrupt(&mut self) -> bool {
        false
    }
}

fn told(coded: Coded) -> Told {
    let taken = Mailbox::default().take(&BusFrame::from(coded));
    taken.expect("one of ours").expect("a sound one")
}

fn command(coded: Option<Coded>) -> Command {
    match told(coded.expect("a frame")) {
        Told::Command(command) => command,
        other => panic!("{other:?}"),
    }
}

fn answer(node: &mut Mailbox, command: Command, outcome: Outcome) -> BusFrame {
    let answer = Told::Answer(Answer {
        number: command.number,
        token: command.token,
        outcome: Some(outcome),
        detail: 55,
    });
    BusFrame::from(node.send(&answer).expect("an answer"))
}

#[test]
fn a_request_is_repeated_until_it_is_answered_and_frames_keep_their_distance() {
    let (mut dialog, mut node) = (Dialog::new(Three::default(), 8), Mailbox::default());
    let asked = command(dialog.poll(0));
    assert_eq!((asked.request, asked.token), (Some(TELL), 9));
    assert_eq!((dialog.poll(99_999), dialog.due_us()), (None, 100_000));
    assert_eq!(command(dialog.poll(100_000)), asked);
    // An answer to something else; then one that is not the last.
    let other = Command { token: 10, ..asked };
    dialog.take(&answer(&mut node, other, Outcome::Done), 150_000);
    dialog.take(&answer(&mut node, asked, Outcome::Started), 150_000);
    assert_eq!((dialog.poll(249_999), dialog.due_us()), (None, 250_000));
    dialog.take(&answer(&mut node, asked, Outcome::Done), 249_999);
    assert_eq!(dialog.job().answers, [Some((Some(Outcome::Done), 55))]);
    let sent = dialog.poll(249_999).map(told);
    assert_eq!(sent, Some(Told::UpdateData(word(2))));
    assert_eq!(dialog.poll(250_998), None);
    let sent = dialog.poll(250_999).map(told);
    assert_eq!(sent, Some(Told::UpdateData(word(3))));
    assert_eq!(dialog.poll(251_999), None);
    assert!(dialog.is_over());
}

#[test]
fn nobody_is_waited_for_longer_than_three_seconds() {
    let mut dialog = Dialog::new(Three::default(), 8);
    let sent = (0..3_000).filter(|ms| dialog.poll(ms * 1_000).is_some());
    assert_eq!(sent.count(), 30);
    assert_eq!(dialog.job().answers, []);
    assert!(dialog.poll(3_000_000).is_some());
    assert_eq!(dialog.job().answers, [None]);
}

#[test]
fn where_another_host_asks_for_something_else_under_the_same_token_it_is_asked_anew() {
    let another = Request::Update(UpdateRequest::Tell { page: 4 });
    let (mut dialog, mut node) = (Dialog::new(Three::default(), 8), Mailbox::default());
    let mut host = Mailbox::default();
    let mut hears = |dialog: &mut Dialog<Three>, request, token| {
        let told = Told::Command(Command::new(request, token));
        dialog.take(&BusFrame::from(host.send(&told).expect("it")), 500);
    };
    // While it waits, and before it asks.
    let asked = command(dialog.poll(0));
    hears(&mut dialog, another, asked.token);
    dialog.take(&answer(&mut node, asked, Outcome::Done), 600);
    assert_eq!(dialog.job().answers, []);
    hears(&mut dialog, another, 11);
    let anew = command(dialog.poll(1_000));
    assert_eq!((anew.request, anew.token), (asked.request, 10));
    let mut dialog = Dialog::new(Three::default(), 8);
    hears(&mut dialog, another, 9);
    let asked = command(dialog.poll(0));
    assert_eq!(asked.token, 10);
    // What both ask for has one answer.
    hears(&mut dialog, TELL, asked.token);
    dialog.take(&answer(&mut node, asked, Outcome::Done), 600);
    assert_eq!(dialog.job().answers.len(), 1);
}
